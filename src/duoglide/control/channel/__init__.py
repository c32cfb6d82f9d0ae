"""All that crosses between host and streamer: orders and setpoints there, records back."""
