"""Rules on the text of the file (XML). The readers detect these problems while parsing."""
