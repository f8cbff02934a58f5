//! The svartboks recorder: CAN frames in, sealed crash records out.
