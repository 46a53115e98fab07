"""What is proven about the program: campaigns and checks that are not shipped with it."""
