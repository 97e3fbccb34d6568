"""What goes out: `record` gathers it as numbers, `message` writes it as the MessagePack of an ArmsState."""
