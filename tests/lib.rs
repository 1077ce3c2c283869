//! What the validation suites share. The suites themselves are the test targets beside this file, one for each kind of evidence.
