//! bincode behind one door: fixed-size little-endian integers, a limit, and no trailing bytes.
