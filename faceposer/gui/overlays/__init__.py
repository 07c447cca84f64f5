"""What is drawn over the view for constraints."""
