//! How the daemon comes up: settings, what an earlier run left, spool, threads, sources; and how it goes down.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use nix::fcntl::{Flock, FlockArg};
use nix::sys::mman::{MlockAllFlags, mlockall};
use schema::{Sample, num};
use sd_notify::NotifyState;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use super::control::{Control, Shared};
use super::keeper::{Opened, disk_trouble, open_keeper};
use super::paced::Paced;
use super::sealer::{Keeper, Sealer, Span};
use super::self_test::SelfTest;
use super::status::{RecordsStatus, SpoolStatus};
use super::{Daemon, Signals};
use crate::clock::monotonic_ns;
use crate::config::{Bundle, Settings};
use crate::error::RecorderError;
use crate::live::LiveSource;
use crate::pipeline::{Observer, Pipeline};
use crate::recovery::{Recovered, recover};
use crate::replay::LogInput;
use crate::socket::Sockets;
use crate::spool::{self, Found, Journal, SpoolFile, Syncer};
use crate::storage::{Disk, Storage, beside};
use crate::store::RESERVE_BYTES;

/// What `recorder run` is asked for.
#[derive(Debug, Default)]
pub struct Options {
    /// Configuration (TOML).
    pub config: PathBuf,
    /// Logs at the pace of their stamps in place of the CAN interfaces.
    pub paced: Vec<PathBuf>,
    /// Pairs (interface in the log, configured interface).
    pub map: Vec<(String, String)>,
}

/// Runs until it is told to stop, or a paced log has ended.
///
/// # Errors
/// When the configuration, the folder of the records or the socket can not be used, or another recorder runs there.
pub fn run(options: &Options) -> Result<(), RecorderError> {
    let (settings, bundle) = Settings::load_bundled(&options.config)?;
    let settings = Arc::new(settings);
    let _only = match lock(&settings.store.dir) {
        Ok(only) => Some(only),
        Err(error) if disk_trouble(&error) => {
            tracing::error!("{error}");
            None
        }
        Err(error) => return Err(error),
    };
    let signals = signals()?;
    let storage: Arc<dyn Storage> = Arc::new(Disk);
    let Opened {
        mut keeper,
        signed,
        notes,
    } = open_keeper(&storage, &settings)?;
    for note in notes {
        tracing::warn!("{note}");
    }
    let mut recovered = read_back(storage.as_ref(), &settings);
    let unsealed = seal_recovered(&mut recovered, keeper.as_mut());
    let blocked = !unsealed.is_empty();
    let sealer = Sealer::start(keeper, unsealed)?;
    let digest = bundle.digest();
    let shared = Arc::new(Shared::default());
    let (give, commands) = sync_channel(4);
    let control = Control::start(&settings.run.socket, Arc::clone(&shared), give)?;
    let self_test = Rc::new(RefCell::new(SelfTest::new(&settings)));
    let observed = Rc::clone(&self_test);
    let observer: Observer<'static> =
        Box::new(move |_, sample: &Sample| observed.borrow_mut().sample(sample));
    let begin: Begin = {
        let (settings, found) = (Arc::clone(&settings), std::mem::take(&mut recovered.found));
        Arc::new(move || begin_spool(&storage, &settings, &bundle, &found))
    };
    super::say::start();
    let mut daemon = Daemon {
        config: options.config.clone(),
        bundle: digest,
        pipeline: Pipeline::new(Arc::clone(&settings), &[], Some(observer)),
        source: source(&settings, options)?,
        ear: super::gnss::Ear::start(&settings)?,
        journal: Journal::new(),
        syncer: None,
        spool_error: None,
        begin,
        beginning: None,
        begun_ns: 0,
        blocked,
        running: Vec::new(),
        sealer,
        self_test,
        findings: Vec::new(),
        faults: Vec::new(),
        tested_ns: None,
        _control: control,
        shared,
        commands,
        signals,
        started_ns: monotonic_ns(),
        flushed_ns: monotonic_ns(),
        house_ns: 0,
        counts_ns: 0,
        spool_status: (0, SpoolStatus::default()),
        watchdog_ns: sd_notify::watchdog_enabled()
            .map(|period| i64::try_from(period.as_nanos()).unwrap_or(i64::MAX)),
        watched_ns: 0,
        urgent: false,
        silent: [false; 4],
        reload: false,
        last_trigger: None,
        records: RecordsStatus {
            dir: settings.store.dir.display().to_string(),
            signed,
            ..RecordsStatus::default()
        },
        waiting: None,
        lost: 0,
        settings: Arc::clone(&settings),
    };
    // This thread, and the spool's which is begun below; those of records and socket are not in a hurry.
    privileges(&settings);
    daemon.begin_spool();
    let _ = sd_notify::notify(&[NotifyState::Ready]);
    tracing::info!(config = %options.config.display(), "recording");
    let done = daemon.run();
    let _ = sd_notify::notify(&[NotifyState::Stopping]);
    daemon.finish();
    super::say::info("stopped");
    super::say::finish();
    done
}

/// One recorder a folder.
fn lock(dir: &Path) -> Result<Flock<File>, RecorderError> {
    let path = dir.join("recorder.lock");
    std::fs::create_dir_all(dir)
        .map_err(RecorderError::io(dir, "create the folder of the records"))?;
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(false).mode(0o640);
    let file = options
        .open(&path)
        .map_err(RecorderError::io(&path, "open the lock"))?;
    Flock::lock(file, FlockArg::LockExclusiveNonblock).map_err(|(_, error)| {
        RecorderError::io(&path, "lock the folder (does another recorder run there?)")(error.into())
    })
}

fn signals() -> Result<Signals, RecorderError> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let signals = Signals::default();
    for (signal, flag) in [
        (SIGTERM, &signals.stop),
        (SIGINT, &signals.stop),
        (SIGHUP, &signals.reload),
    ] {
        signal_hook::flag::register(signal, Arc::clone(flag))
            .map_err(RecorderError::io("signals", "register"))?;
    }
    Ok(signals)
}

/// Reads the spool back. One that can not be, or whose reading ended the program twice before, is set aside whole, for it
/// may hold the only word of a crash.
fn read_back(storage: &dyn Storage, settings: &Settings) -> Recovered {
    let spool = &settings.spool.file;
    let tries = beside(spool, "tries");
    let tried = storage
        .read(&tries, 16)
        .ok()
        .and_then(|text| String::from_utf8(text).ok()?.trim().parse::<u32>().ok())
        .unwrap_or(0);
    if tried >= MOST_TRIES {
        set_aside(
            storage,
            spool,
            "reading it back ended the recorder again and again",
        );
        let _ = storage.remove(&tries);
        return Recovered::default();
    }
    let count = |tried: u32| -> std::io::Result<()> {
        let mut file = storage.create(&tries)?;
        file.write_at(0, format!("{tried}\n").as_bytes())?;
        file.sync()
    };
    let counted = count(tried + 1);
    let recovered = recover(storage, spool);
    if counted.is_ok() {
        let _ = storage.remove(&tries);
    }
    let recovered = match recovered {
        Ok(recovered) => recovered,
        Err(error) => {
            set_aside(storage, spool, &error.to_string());
            return Recovered::default();
        }
    };
    for note in &recovered.notes {
        tracing::warn!("{note}");
    }
    if let (Some(last), false) = (recovered.last_ns, recovered.ended) {
        tracing::warn!(
            "the last recording was cut at {}; {} frames of it were read back, {} events were unfinished",
            super::housekeeping::iso(last),
            recovered.frames,
            recovered.records.len()
        );
    }
    if recovered.unreadable {
        set_aside(
            storage,
            spool,
            "the settings that its frames were received under are not there",
        );
        return Recovered {
            found: Found::default(),
            ..recovered
        };
    }
    recovered
}

/// Times that a spool is tried to be read.
const MOST_TRIES: u32 = 3;

/// Gives a spool that can not be read another name, where it stays for somebody to look into.
fn set_aside(storage: &dyn Storage, spool: &Path, why: &str) {
    let free = (1..1000)
        .map(|number| beside(spool, &format!("unread-{number}")))
        .find(|path| storage.length(path).is_err());
    let Some(place) = free else { return };
    match storage.rename(spool, &place) {
        Ok(()) => tracing::error!(
            "the spool of an earlier run could not be read ({why}): it may hold an event and is kept as {}",
            place.display()
        ),
        Err(error) => tracing::error!(
            "the spool of an earlier run could not be read ({why}), nor set aside: {error}"
        ),
    }
}

/// Seals what was unfinished; gives back what found no room, with the time of its first trigger.
fn seal_recovered(
    recovered: &mut Recovered,
    keeper: &mut dyn Keeper,
) -> VecDeque<(schema::Record, Span)> {
    let mut left = VecDeque::new();
    for record in std::mem::take(&mut recovered.records) {
        // In UTC: the session that its line was of is over, and the spool of the next knows nothing of it.
        let span = (record.utc_ns(), record.utc_ns());
        match keeper.seal(record) {
            Ok(kept) => {
                tracing::warn!(path = %kept.path.display(), "an unfinished event was sealed");
            }
            Err(refused) => {
                tracing::error!("an unfinished event waits in memory: {}", refused.reason);
                left.push_back((refused.record, span));
            }
        }
    }
    left
}

/// Begins the spool's file and its thread.
pub(super) type Begin = Arc<dyn Fn() -> Result<Syncer, RecorderError> + Send + Sync>;

fn begin_spool(
    storage: &Arc<dyn Storage>,
    settings: &Settings,
    bundle: &Bundle,
    found: &Found,
) -> Result<Syncer, RecorderError> {
    let digest = spool::bundles::store(storage.as_ref(), &settings.spool.file, bundle)?;
    spool::bundles::forget(storage.as_ref(), &settings.spool.file, &[digest])?;
    let blocks = spool::blocks_for(settings);
    if found.total != blocks {
        // What the spool takes must not be the room of the records.
        let folder = settings.spool.file.parent().unwrap_or(Path::new(""));
        let wanted =
            blocks.saturating_mul(num::u64_of(spool::block::BLOCK_BYTES)) + 2 * RESERVE_BYTES;
        let free = storage.free_bytes(folder).unwrap_or(u64::MAX);
        if free < wanted {
            return Err(
                RecorderError::io(&settings.spool.file, "lay out the spool")(std::io::Error::new(
                    std::io::ErrorKind::StorageFull,
                    format!("expected {wanted} bytes free, found {free}"),
                )),
            );
        }
    }
    let session = found.session().wrapping_add(1).max(1);
    let file = SpoolFile::begin(storage, &settings.spool.file, blocks, found, session)?;
    Syncer::start(file, monotonic_ns)
}

fn source(settings: &Settings, options: &Options) -> Result<Box<dyn LiveSource>, RecorderError> {
    if options.paced.is_empty() {
        return Ok(Box::new(Sockets::open(settings)?));
    }
    let inputs = options.paced.iter().cloned().map(LogInput::File).collect();
    Ok(Box::new(Paced::open(settings, inputs, &options.map)?))
}

/// Priority and memory as configured. What is not allowed is told; recording goes on without.
fn privileges(settings: &Settings) {
    if settings.run.lock_memory {
        let all = MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE;
        if let Err(error) = mlockall(all) {
            tracing::error!(
                "the memory could not be locked (CAP_IPC_LOCK, LimitMEMLOCK=): {error}"
            );
        }
    }
    if let Some(priority) = settings.run.realtime_priority {
        let value = ThreadPriorityValue::try_from(priority);
        let set = value.and_then(|value| {
            set_thread_priority_and_policy(
                thread_native_id(),
                ThreadPriority::Crossplatform(value),
                ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
            )
            .map_err(|error| format!("{error}"))
        });
        if let Err(error) = set {
            tracing::error!("SCHED_FIFO could not be set (CAP_SYS_NICE, LimitRTPRIO=): {error}");
        }
    }
}

/// Settings that were read again.
pub(super) struct Reloaded {
    pub(super) settings: Settings,
    /// Names their bundle.
    pub(super) digest: [u8; 32],
    /// Something changed that is only looked at when the daemon starts.
    pub(super) needs_restart: bool,
}

/// Reads the configuration again and hands it to the source, once the spool can name it. What is only looked at when the
/// daemon starts stays as it was.
pub(super) fn reload(
    config: &Path,
    old: &Settings,
    source: &mut dyn LiveSource,
) -> Result<Reloaded, RecorderError> {
    let (mut settings, bundle) = Settings::load_bundled(config)?;
    let of = |settings: &Settings| {
        let (store, spool, run) = (&settings.store, &settings.spool, &settings.run);
        format!("{store:?} {spool:?} {run:?}")
    };
    let needs_restart = of(old) != of(&settings);
    settings.store = old.store.clone();
    settings.spool = old.spool.clone();
    settings.run = old.run.clone();
    let digest = if settings.spool.enabled {
        spool::bundles::store(&Disk, &settings.spool.file, &bundle)?
    } else {
        bundle.digest()
    };
    source.reconfigure(&settings)?;
    Ok(Reloaded {
        settings,
        digest,
        needs_restart,
    })
}
