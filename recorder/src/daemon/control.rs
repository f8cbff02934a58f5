//! The Unix socket: one line asks, one line of JSON answers.
//!
//! `status`: the [`Status`]; `watch`: one each second until the other side goes; `trigger`: a manual trigger. A
//! client has a second to ask and to take the answer. At most eight are served at a time.

use std::fs;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::status::Status;
use crate::error::RecorderError;

const MOST_CLIENTS: usize = 8;
const PATIENCE: Duration = Duration::from_secs(1);

/// What a client asks of the receiving thread; the answer goes back by the channel.
#[derive(Debug)]
pub enum Command {
    /// A manual trigger, now.
    Trigger(SyncSender<Answer>),
}

/// The answer to a command.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Answer {
    /// It was done.
    pub ok: bool,
    /// What was done, or why not.
    pub message: String,
}

/// Shared between the receiving thread and the socket's.
#[derive(Debug, Default)]
pub struct Shared {
    /// The newest state.
    pub status: Mutex<Status>,
    clients: AtomicUsize,
    over: AtomicBool,
}

impl Shared {
    /// The newest state.
    #[must_use]
    pub fn status(&self) -> Status {
        self.status
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Replaces it.
    pub fn set(&self, status: Status) {
        *self.status.lock().unwrap_or_else(PoisonError::into_inner) = status;
    }
}

/// The listening socket; removed when dropped.
#[derive(Debug)]
pub struct Control {
    path: PathBuf,
    shared: Arc<Shared>,
}

impl Control {
    /// Binds the socket (mode 0660) and serves it in a thread. The daemon holds the lock of its folder, so a socket
    /// file that is there is left over.
    ///
    /// # Errors
    /// When the path can not be bound.
    pub fn start(
        path: &Path,
        shared: Arc<Shared>,
        commands: SyncSender<Command>,
    ) -> Result<Self, RecorderError> {
        let error = |action| RecorderError::io(path, action);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(error("create the folder of the socket"))?;
        }
        match fs::remove_file(path) {
            Err(gone) if gone.kind() == ErrorKind::NotFound => {}
            other => other.map_err(error("remove the socket left over"))?,
        }
        let listener = UnixListener::bind(path).map_err(error("bind the socket"))?;
        fs::set_permissions(path, fs::Permissions::from_mode(0o660))
            .map_err(error("set the mode of the socket"))?;
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new()
            .name("control".to_owned())
            .spawn(move || serve(&listener, &of_thread, &commands))
            .map_err(error("start the thread of the socket"))?;
        Ok(Self {
            path: path.to_path_buf(),
            shared,
        })
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        let _ = fs::remove_file(&self.path);
    }
}

fn serve(listener: &UnixListener, shared: &Arc<Shared>, commands: &SyncSender<Command>) {
    for client in listener.incoming() {
        if shared.over.load(Ordering::Relaxed) {
            return;
        }
        let Ok(client) = client else {
            // Out of descriptors, perhaps: not so fast.
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        if shared.clients.fetch_add(1, Ordering::Relaxed) >= MOST_CLIENTS {
            shared.clients.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let (of_client, commands) = (Arc::clone(shared), commands.clone());
        let work = move || {
            // A client that goes away is its own business.
            let _ = attend(&client, &of_client, &commands);
            of_client.clients.fetch_sub(1, Ordering::Relaxed);
        };
        let started = std::thread::Builder::new()
            .name("client".to_owned())
            .stack_size(256 * 1024)
            .spawn(work);
        if started.is_err() {
            shared.clients.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

fn attend(client: &UnixStream, shared: &Shared, commands: &SyncSender<Command>) -> io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    client.set_write_timeout(Some(PATIENCE))?;
    let mut asked = String::new();
    BufReader::new(client.take(256)).read_line(&mut asked)?;
    let mut client = client;
    let mut answer = |text: String| writeln!(client, "{text}");
    match asked.trim() {
        "status" => answer(json(&shared.status())),
        "watch" => loop {
            answer(json(&shared.status()))?;
            if shared.over.load(Ordering::Relaxed) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_secs(1));
        },
        "trigger" => {
            let (give, answered) = sync_channel(1);
            let failed = |message: &str| Answer {
                ok: false,
                message: message.to_owned(),
            };
            let result = match commands.try_send(Command::Trigger(give)) {
                Err(_) => failed("too many commands are waiting"),
                Ok(()) => answered
                    .recv_timeout(PATIENCE)
                    .unwrap_or_else(|_| failed("the recorder did not answer within 1 s")),
            };
            answer(json(&result))
        }
        other => answer(json(&Answer {
            ok: false,
            message: format!(
                "expected status, watch or trigger, found `{}`",
                other.escape_default()
            ),
        })),
    }
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Asks a running daemon; gives each line of the answer to `take` until that says enough.
///
/// # Errors
/// When nobody listens there, or the answer stops.
pub fn ask(
    socket: &Path,
    question: &str,
    mut take: impl FnMut(&str) -> Result<bool, RecorderError>,
) -> Result<(), RecorderError> {
    let mut stream = UnixStream::connect(socket).map_err(RecorderError::io(
        socket,
        "reach the recorder (is it running?)",
    ))?;
    let error = |action| RecorderError::io(socket, action);
    stream
        .set_read_timeout(Some(Duration::from_secs(5)))
        .map_err(error("set up"))?;
    writeln!(stream, "{question}").map_err(error("ask"))?;
    let mut lines = BufReader::new(stream);
    let mut line = String::new();
    loop {
        line.clear();
        let count = lines
            .read_line(&mut line)
            .map_err(error("read the answer"))?;
        if count == 0 || take(line.trim_end())? {
            return Ok(());
        }
    }
}
