"""Loads and motions of which the steps see too little: what swings within steps, pulses as short as a step."""
