"""What is said of contact laws where they leave what they cover."""
