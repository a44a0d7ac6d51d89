"""Long scans put to the test: killed, on full disks, with dying workers, with damaged files."""
