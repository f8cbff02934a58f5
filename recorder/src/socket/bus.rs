//! What error frames say of the bus and of the controller on it.

use crate::can::{ERR, Frame};

/// Classes of error frames: bits of the identifier (linux/can/error.h).
const CONTROLLER: u32 = 0x04;
const BUS_OFF: u32 = 0x40;
const RESTARTED: u32 = 0x100;
/// Bits of the second byte of [`CONTROLLER`].
const OVERFLOWED: u8 = 0x01;
const WARNING: u8 = 0x0C;
const PASSIVE: u8 = 0x30;
const ACTIVE: u8 = 0x40;

/// State of the controller, as far as it has been told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Controller {
    /// As it should be.
    #[default]
    Active,
    /// 96 errors counted.
    Warning,
    /// 128 errors counted: it may no longer speak up.
    Passive,
    /// Off the bus.
    BusOff,
}

/// What an error frame brings that is worth telling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct News {
    /// The state changed to this.
    pub state: Option<Controller>,
    /// It went bus-off.
    pub bus_off: bool,
    /// It was started again.
    pub restarted: bool,
    /// It had no room for a frame: one was lost before it reached the kernel.
    pub overflowed: bool,
}

impl Controller {
    /// One sentence without the interface's name.
    pub(super) fn says(self) -> &'static str {
        match self {
            Self::Active => "the controller is error-active again",
            Self::Warning => "the controller counts many errors (error-warning)",
            Self::Passive => "the controller is error-passive",
            Self::BusOff => "the controller went bus-off",
        }
    }

    /// Takes an error frame in.
    pub(super) fn hear(&mut self, frame: &Frame) -> News {
        let class = frame.id & !ERR;
        let detail = match frame.data() {
            [_, detail, ..] if class & CONTROLLER != 0 => *detail,
            _ => 0,
        };
        let bus_off = class & BUS_OFF != 0;
        let restarted = class & RESTARTED != 0;
        let state = if bus_off {
            Self::BusOff
        } else if detail & PASSIVE != 0 {
            Self::Passive
        } else if detail & WARNING != 0 {
            Self::Warning
        } else if restarted || detail & ACTIVE != 0 {
            Self::Active
        } else {
            *self
        };
        let changed = state != std::mem::replace(self, state);
        News {
            state: changed.then_some(state),
            bus_off,
            restarted,
            overflowed: detail & OVERFLOWED != 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_told_once() {
        let mut controller = Controller::default();
        let mut hear = |class: u32, detail: u8| {
            let data = [0, detail, 0, 0, 0, 0, 0, 0];
            controller.hear(&Frame::new(0, 0, ERR | class, 0, &data))
        };
        assert_eq!(hear(CONTROLLER, 0x08).state, Some(Controller::Warning));
        assert_eq!(hear(CONTROLLER, 0x08), News::default());
        assert_eq!(hear(CONTROLLER, 0x20).state, Some(Controller::Passive));
        assert!(hear(CONTROLLER, 0x01).overflowed);
        assert_eq!(
            hear(0x20, 0xFF),
            News::default(),
            "no acknowledgement: counted, no more"
        );
        let off = hear(BUS_OFF, 0);
        assert!(off.bus_off && off.state == Some(Controller::BusOff));
        let back = hear(RESTARTED, 0);
        assert!(back.restarted && back.state == Some(Controller::Active));
    }

    #[test]
    fn an_error_frame_without_data_is_no_harm() {
        let news = Controller::default().hear(&Frame::new(0, 0, ERR | CONTROLLER, 0, &[]));
        assert_eq!(news, News::default());
    }
}
