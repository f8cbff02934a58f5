//! How the daemon comes up: settings, what an earlier run left, spool, threads, sources; and how it goes down.

use std::cell::RefCell;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use nix::fcntl::{Flock, FlockArg};
use nix::sys::mman::{MlockAllFlags, mlockall};
use schema::Sample;
use sd_notify::NotifyState;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use super::control::{Control, Shared};
use super::keeper::{Opened, open_keeper};
use super::paced::Paced;
use super::sealer::{Keeper, Sealer};
use super::self_test::SelfTest;
use super::status::RecordsStatus;
use super::{Daemon, Signals};
use crate::clock::monotonic_ns;
use crate::config::{Bundle, Settings};
use crate::error::RecorderError;
use crate::live::LiveSource;
use crate::pipeline::{Observer, Pipeline};
use crate::recovery::{Recovered, recover};
use crate::replay::LogInput;
use crate::socket::Sockets;
use crate::spool::{self, Entry, Journal, SpoolFile, Syncer};
use crate::storage::{Disk, Storage};

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
    let _only = lock(&settings.store.dir)?;
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
    let sealer = Sealer::start(keeper)?;
    let digest = bundle.digest();
    let shared = Arc::new(Shared::default());
    let (give, commands) = sync_channel(4);
    let control = Control::start(&settings.run.socket, Arc::clone(&shared), give)?;
    let self_test = Rc::new(RefCell::new(SelfTest::new(&settings)));
    let observed = Rc::clone(&self_test);
    let observer: Observer<'static> =
        Box::new(move |_, sample: &Sample| observed.borrow_mut().sample(sample));
    let mut daemon = Daemon {
        config: options.config.clone(),
        bundle: digest,
        pipeline: Pipeline::new(Arc::clone(&settings), &[], Some(observer)),
        source: source(&settings, options)?,
        journal: Journal::new(),
        syncer: None,
        spool_error: None,
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
    for (record, trigger_ns) in unsealed {
        // What is left of an earlier run and found no room stays in the spool too, which is not written until it has.
        daemon.sealer.seal(record, trigger_ns);
        daemon.spool_error = Some("an unfinished event waits for room on the disk, and the spool holds its only durable copy".to_owned());
    }
    // This thread, and the spool's which is begun below; those of records and socket are not in a hurry.
    privileges(&settings);
    if settings.spool.enabled && daemon.spool_error.is_none() {
        match begin_spool(&storage, &settings, &bundle, &recovered) {
            Ok(syncer) => daemon.syncer = Some(syncer),
            Err(error) => {
                tracing::error!("the ring is in memory only: {error}");
                daemon.spool_error = Some(error.to_string());
            }
        }
    }
    let now = daemon.source.now_ns();
    daemon.spool(&Entry::Session {
        at_ns: now,
        bundle: digest,
    });
    let _ = sd_notify::notify(&[NotifyState::Ready]);
    tracing::info!(config = %options.config.display(), "recording");
    let done = daemon.run();
    let _ = sd_notify::notify(&[NotifyState::Stopping]);
    daemon.finish();
    tracing::info!("stopped");
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

fn read_back(storage: &dyn Storage, settings: &Settings) -> Recovered {
    let recovered = recover(storage, &settings.spool.file).unwrap_or_else(|error| {
        tracing::error!("what an earlier run left can not be read: {error}");
        Recovered::default()
    });
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
    recovered
}

/// Seals what was unfinished; gives back what found no room, with the time of its first trigger.
fn seal_recovered(
    recovered: &mut Recovered,
    keeper: &mut dyn Keeper,
) -> Vec<(schema::Record, i64)> {
    let mut left = Vec::new();
    for record in std::mem::take(&mut recovered.records) {
        let first = record
            .triggers
            .first()
            .map_or(0, |first| first.monotonic_ns);
        let utc = first.saturating_add(record.header.clock.offset_ns);
        match keeper.seal(record) {
            Ok(kept) => {
                tracing::warn!(path = %kept.path.display(), "an unfinished event was sealed");
            }
            Err(refused) => {
                tracing::error!("an unfinished event waits in memory: {}", refused.reason);
                left.push((refused.record, utc));
            }
        }
    }
    left
}

fn begin_spool(
    storage: &Arc<dyn Storage>,
    settings: &Settings,
    bundle: &Bundle,
    recovered: &Recovered,
) -> Result<Syncer, RecorderError> {
    let digest = spool::bundles::store(storage.as_ref(), &settings.spool.file, bundle)?;
    spool::bundles::forget(storage.as_ref(), &settings.spool.file, &[digest])?;
    let session = recovered.found.session().wrapping_add(1).max(1);
    let file = SpoolFile::begin(
        storage,
        &settings.spool.file,
        spool::blocks_for(settings),
        &recovered.found,
        session,
    )?;
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

/// Reads the configuration again and hands it to the source.
pub(super) fn reload(
    config: &Path,
    source: &mut dyn LiveSource,
) -> Result<(Settings, Bundle), RecorderError> {
    let (settings, bundle) = Settings::load_bundled(config)?;
    source.reconfigure(&settings)?;
    Ok((settings, bundle))
}

/// Stores the bundle of the settings in force from now on.
pub(super) fn store_bundle(
    settings: &Settings,
    bundle: &Bundle,
) -> Result<[u8; 32], RecorderError> {
    spool::bundles::store(&Disk, &settings.spool.file, bundle)
}
