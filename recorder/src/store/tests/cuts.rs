//! A loss of power at any instant: from every state it may leave, the vault goes on.

use super::*;

/// Seals some events with a crash among them under the keep rule; after which change each was acknowledged.
fn run(model: &Model) -> Vec<(usize, Record)> {
    let (mut vault, _) = open(model, 2);
    let mut acknowledged = Vec::new();
    for number in 1..=5 {
        let record = if number == 2 {
            crash(2, 45.0)
        } else {
            event(number)
        };
        vault.seal(record.clone()).unwrap();
        acknowledged.push((model.changes(), record));
    }
    acknowledged
}

/// Asserts what must hold of what a cut left.
fn recovers(left: &Model, acknowledged: &[(usize, Record)], count: usize) -> (usize, usize) {
    left.create_folder(Path::new(DIR)).unwrap();
    let (mut vault, notes) = open(left, 2);
    let taken = notes.iter().find(|note| note.contains("taken away"));
    assert_eq!(taken, None);
    for (at, record) in acknowledged {
        assert!(*at > count || vault.sealed_already(record.utc_ns()));
    }
    let finished = notes
        .iter()
        .filter(|note| note.contains("finished"))
        .count();
    // What was not sealed is sealed now, as the daemon does from its spool; then all is as without a cut.
    let mut sealed_now = 0;
    for (_, record) in acknowledged {
        let sealed = vault.seal(record.clone()).unwrap();
        sealed_now += usize::from(!sealed.already);
    }
    let found = assert_whole(left, &vault);
    assert_eq!(found.records.len(), acknowledged.len());
    assert_eq!(numbers(&vault), [2, 4, 5]);
    assert!(vault.records().next().unwrap().locked);
    // Nothing is left lying about.
    let mut names = left.list(Path::new(DIR)).unwrap();
    names.retain(|path| path.extension().is_none_or(|ending| ending != "svb"));
    let names: Vec<_> = names
        .iter()
        .filter_map(|path| path.file_name()?.to_str())
        .collect();
    assert!(
        names
            .iter()
            .all(|name| [FILE_NAME, ".reserve", ".ledger.part"].contains(name)),
        "{names:?}"
    );
    // And so it is found again.
    let (vault, notes) = open(left, 2);
    assert_eq!((numbers(&vault), notes), (vec![2, 4, 5], vec![]));
    (finished, sealed_now)
}

#[test]
fn from_every_state_a_cut_may_leave_the_chain_goes_on_and_nothing_acknowledged_is_lost() {
    let model = Model::new();
    let acknowledged = run(&model);
    let cuts = [Cut::Process, Cut::Least]
        .into_iter()
        .chain((0..40).map(Cut::Some));
    let (mut states, mut finished, mut sealed_now) = (0, 0, 0);
    for cut in cuts {
        for count in 0..=model.changes() {
            let seed = u64::try_from(count).unwrap() * 1_000;
            let cut = if let Cut::Some(number) = cut {
                Cut::Some(seed + number)
            } else {
                cut
            };
            let left = model.after_cut(count, cut);
            let (a, b) = recovers(&left, &acknowledged, count);
            states += 1;
            finished += a;
            sealed_now += b;
        }
    }
    println!(
        "{states} states: {finished} sealings or removals finished, {sealed_now} records sealed anew"
    );
    assert!(states > 2_000 && finished > 500 && sealed_now > 4_000);
}

#[test]
fn a_cut_while_it_recovers_from_a_cut_is_recovered_from_too() {
    let model = Model::new();
    let acknowledged = run(&model);
    for count in (0..=model.changes()).step_by(2) {
        let seed = u64::try_from(count).unwrap();
        let first = model.after_cut(count, Cut::Some(seed));
        first.create_folder(Path::new(DIR)).unwrap();
        let (mut vault, _) = open(&first, 2);
        let _ = vault.seal(acknowledged[0].1.clone());
        for second in 0..=first.changes() {
            let left = first.after_cut(second, Cut::Some(seed * 77 + 5));
            recovers(&left, &acknowledged, count.min(acknowledged[0].0));
        }
    }
}
