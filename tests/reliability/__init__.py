"""Every input of a user ends accepted, or refused in one sentence: a fuzzer on hypothesis (see `explore`)."""
