"""Where a step would lead: contacts that it meets and gaps that bend, looked for at its end before it is believed."""
