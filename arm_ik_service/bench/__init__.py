"""Measurements that a user can repeat: what `arm-ik bench` runs. Nothing else imports this room."""
