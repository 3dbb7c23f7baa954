"""What a run ought to give: closed forms, and references independent of the methods that are tried."""
