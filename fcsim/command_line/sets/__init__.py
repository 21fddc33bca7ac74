"""fcsim collection | bench | profile | report | leaderboard: sets of FCLIB problems, made and measured."""
