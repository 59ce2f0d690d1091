def applies(r):
    return False
