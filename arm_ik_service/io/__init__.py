"""Where bytes come from and go to; each module is the only importer of its library."""
