//! What is solved and rendered together: all runs at all times where their light fits into memory, else some times of some runs.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use std::ops::Range;

/// What a run asks for.
pub(super) struct Asked {
    pub times: Vec<OfTime>,
    /// Bytes that it keeps for each time beside the sky.
    pub own: usize,
}

/// What a run asks for at one time.
pub(super) struct OfTime {
    /// What puts times in order: ascending within a run.
    pub at: f64,
    /// Column and sun, which runs are solved together for.
    pub under: usize,
    /// The sky, which is kept once for all that share it.
    pub sky: usize,
}

/// Numbers for values, the same for what is equal.
pub(super) fn numbered<T: Hash + Eq>(known: &mut HashMap<T, usize>, value: T) -> usize {
    let next = known.len();
    *known.entry(value).or_insert(next)
}

/// Bytes that all runs keep at all times; `skies` has those of each sky.
pub(super) fn whole(asked: &[Asked], skies: &[usize]) -> usize {
    let held: HashSet<usize> = asked.iter().flat_map(|run| &run.times).map(|time| time.sky).collect();
    held.into_iter().map(|sky| skies[sky]).sum::<usize>()
        + asked.iter().map(|run| run.own * run.times.len()).sum::<usize>()
}

/// The parts, each of runs (by index) and ranges of their times, that keep no more than `limit` bytes each: every time of every
/// run stands in one of them. What is larger by itself has a part of its own.
///
/// Runs under the same columns and suns stand together, in order of time, so that few skies are solved twice.
pub(super) fn parts(asked: &[Asked], skies: &[usize], limit: usize) -> Vec<Vec<(usize, Range<usize>)>> {
    let mut filling = Filling { asked, skies, limit, held: HashSet::new(), bytes: 0, parts: Vec::new() };
    for runs in clusters(asked) {
        let mut all: Vec<(usize, usize)> =
            runs.into_iter().flat_map(|run| (0..asked[run].times.len()).map(move |t| (run, t))).collect();
        let at = |(run, t): &(usize, usize)| asked[*run].times[*t].at;
        all.sort_by(|a, b| at(a).total_cmp(&at(b)).then(a.1.cmp(&b.1)));
        filling.make_room(&all);
        for at_once in all.chunk_by(|a, b| at(a) == at(b) && a.1 == b.1) {
            filling.make_room(at_once);
            for one in at_once {
                filling.make_room(std::slice::from_ref(one));
                filling.put(*one);
            }
        }
    }
    filling.parts
}

/// Runs that share a column and sun with one another, or with one that both share some with.
fn clusters(asked: &[Asked]) -> Vec<Vec<usize>> {
    let mut first: HashMap<usize, usize> = HashMap::new();
    // By run, one before it of the same cluster or itself.
    let mut before: Vec<usize> = (0..asked.len()).collect();
    fn root(before: &[usize], mut run: usize) -> usize {
        while before[run] != run {
            run = before[run];
        }
        run
    }
    for (run, own) in asked.iter().enumerate() {
        for time in &own.times {
            let (a, b) = (root(&before, *first.entry(time.under).or_insert(run)), root(&before, run));
            before[a.max(b)] = a.min(b);
        }
    }
    let mut clusters: Vec<Vec<usize>> = vec![Vec::new(); asked.len()];
    (0..asked.len()).for_each(|run| clusters[root(&before, run)].push(run));
    clusters.retain(|runs| !runs.is_empty());
    clusters
}

/// Parts that are filled one after another.
struct Filling<'a> {
    asked: &'a [Asked],
    skies: &'a [usize],
    limit: usize,
    /// Skies of the last part, and its bytes.
    held: HashSet<usize>,
    bytes: usize,
    parts: Vec<Vec<(usize, Range<usize>)>>,
}

impl Filling<'_> {
    /// Begins a part where these times do not fit into the last.
    fn make_room(&mut self, times: &[(usize, usize)]) {
        let mut fresh = HashSet::new();
        let added = |(run, t): &(usize, usize)| {
            let sky = self.asked[*run].times[*t].sky;
            let is_new = !self.held.contains(&sky) && fresh.insert(sky);
            self.asked[*run].own + if is_new { self.skies[sky] } else { 0 }
        };
        let bytes = self.bytes + times.iter().map(added).sum::<usize>();
        if self.parts.is_empty() || bytes > self.limit && self.bytes > 0 {
            self.parts.push(Vec::new());
            self.held.clear();
            self.bytes = 0;
        }
    }

    fn put(&mut self, (run, t): (usize, usize)) {
        let sky = self.asked[run].times[t].sky;
        self.bytes += self.asked[run].own + if self.held.insert(sky) { self.skies[sky] } else { 0 };
        let Some(part) = self.parts.last_mut() else { return };
        match part.iter_mut().find(|(known, _)| *known == run) {
            Some((_, times)) => times.end = t + 1,
            None => part.push((run, t..t + 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run at some instants: column and sun are the instant's, the sky that of a ground.
    fn at(instants: impl Iterator<Item = usize>, ground: usize) -> Asked {
        let time = |i: usize| OfTime { at: i as f64, under: i, sky: 2 * i + ground };
        Asked { times: instants.map(time).collect(), own: 1 }
    }

    /// Three runs under the same suns, two of them over one ground, one at every other time, and two under suns of their own: whatever
    /// the limit, each time of each run stands in one part, in order, and no part of more than one time is beyond it.
    #[test]
    fn parts_hold_every_time_of_every_run_once_and_keep_to_the_limit() {
        let asked = [at(0..9, 0), at(20..25, 1), at(0..9, 1), at((0..9).step_by(2), 1), at(30..31, 0)];
        let skies: Vec<usize> = (0..80).map(|sky| 10 + sky % 3).collect();
        let all = whole(&asked, &skies);
        let held = (0..18).chain((20..25).map(|i| 2 * i + 1)).chain([60]);
        assert_eq!(all, held.map(|sky| skies[sky]).sum::<usize>() + 9 + 5 + 9 + 5 + 1);
        for limit in [0, 5, 12, 25, 40, 100, all - 1, all] {
            let parts = parts(&asked, &skies, limit);
            let mut next = vec![0; asked.len()];
            for part in &parts {
                let mut held = HashSet::new();
                let (mut bytes, mut n) = (0, 0);
                for (run, times) in part {
                    assert_eq!(times.start, next[*run], "limit {limit}: {parts:?}");
                    next[*run] = times.end;
                    for time in &asked[*run].times[times.clone()] {
                        bytes += 1 + if held.insert(time.sky) { skies[time.sky] } else { 0 };
                        n += 1;
                    }
                }
                assert!(bytes <= limit || n == 1, "limit {limit}: {bytes} bytes in {part:?}");
            }
            assert_eq!(next, asked.iter().map(|run| run.times.len()).collect::<Vec<_>>());
            assert_eq!(parts.len() == 1, limit >= all);
        }
        // Two grounds under one sun are 10 to 12 bytes each: both, and the three runs, in one part.
        assert_eq!(parts(&asked, &skies, 40)[0], [(0, 0..1), (2, 0..1), (3, 0..1)]);
    }
}
