//! Seeded crashes with known truth, written as CAN logs.
