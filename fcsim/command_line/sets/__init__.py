"""fcsim collection | bench | profile | report: sets of FCLIB problems, made and measured."""
