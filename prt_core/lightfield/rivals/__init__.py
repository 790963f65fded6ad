"""What CEOB is compared with, behind the same calls."""
