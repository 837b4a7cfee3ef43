"""The chain of stages of one finger, from images by physics to bones, tendons, muscles and skin."""
