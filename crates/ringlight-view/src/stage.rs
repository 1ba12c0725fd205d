//! The latest state, between the solver and those who watch it.
//!
//! The solver puts in what has changed and never waits for anyone but the copying of a message; each client takes what has
//! changed since it last took something. So a slow client skips states and slows nobody, and what is kept never grows.

use crate::protocol::{self, Hello, Kind, Status};
use axum::body::Bytes;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{oneshot, watch};

/// Points of the curves that are kept: of more, every other one goes.
const MOST_POINTS: usize = 512;

/// A pause ends when nobody has watched for so long: who loads the page again is back before.
const ABSENCE: Duration = Duration::from_secs(10);

/// Records of a message, bytes: larger messages are cut.
const MESSAGE: usize = 1 << 20;

/// What watchers are shown, and what they wish.
pub struct Stage {
    shown: Mutex<Shown>,
    /// Tells the number of the latest change.
    changes: watch::Sender<u64>,
    watchers: AtomicUsize,
    /// When the last watcher went away.
    left: Mutex<Option<Instant>>,
    paused: AtomicBool,
    stopped: AtomicBool,
    ended: AtomicBool,
    wishes: Mutex<Vec<oneshot::Sender<Model>>>,
    images: Mutex<Vec<Option<Image>>>,
}

/// An encoded image.
#[derive(Clone)]
pub struct Image {
    /// Media type.
    pub media_type: String,
    /// The bytes, which stay where they are.
    pub bytes: ringlight::resources::Bytes,
}

/// A lit model, or why there is none.
pub type Model = Result<Bytes, String>;

#[derive(Default)]
struct Shown {
    change: u64,
    /// Bytes, with the number of the change that brought them.
    hello: (u64, String),
    status: (u64, String),
    places: (u64, Bytes),
    geometry: Vec<(u64, Bytes)>,
    light: Vec<(u64, Bytes)>,
    points: Vec<protocol::Point>,
    /// Statuses between two points.
    stride: usize,
    statuses: usize,
}

/// What has changed.
#[derive(Debug, Default)]
pub struct News {
    /// The number of the latest change.
    pub change: u64,
    /// Texts, then bytes: to be sent in this order.
    pub texts: Vec<String>,
    /// Messages of records.
    pub records: Vec<Bytes>,
}

impl Default for Stage {
    fn default() -> Stage {
        Stage {
            shown: Mutex::default(),
            changes: watch::Sender::new(0),
            watchers: AtomicUsize::new(0),
            left: Mutex::default(),
            paused: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
            ended: AtomicBool::new(false),
            wishes: Mutex::default(),
            images: Mutex::default(),
        }
    }
}

impl Stage {
    /// Begins to show a scene: what it is, the images of its textures, and the geometry of its clusters in order.
    pub fn begin(&self, hello: &Hello, images: Vec<Option<Image>>, geometry: Vec<Vec<u8>>) {
        *lock(&self.images) = images;
        self.change(|shown, now| {
            shown.light = vec![(0, Bytes::new()); geometry.len()];
            shown.geometry = geometry.into_iter().map(|record| (now, record.into())).collect();
            shown.hello = (now, protocol::text(hello));
        });
    }

    /// Shows clusters, by their number, with other geometry; what was their light is no more.
    pub fn reshape(&self, geometry: Vec<(u32, Vec<u8>)>) {
        self.change(|shown, now| {
            replace(&mut shown.light, 0, geometry.iter().map(|(cluster, _)| (*cluster, Vec::new())).collect());
            replace(&mut shown.geometry, now, geometry);
        });
    }

    /// Shows clusters, by their number, in other light.
    pub fn light(&self, light: Vec<(u32, Vec<u8>)>) {
        self.change(|shown, now| replace(&mut shown.light, now, light));
    }

    /// Shows who owns and who holds what: see [`protocol::places`].
    pub fn places(&self, record: Vec<u8>) {
        self.change(|shown, now| {
            if shown.places.1 != record {
                shown.places = (now, record.into());
            }
        });
    }

    /// Tells how far the solver is.
    pub fn status(&self, status: &Status) {
        self.change(|shown, now| {
            shown.status = (now, protocol::text(status));
            if shown.statuses.is_multiple_of(shown.stride.max(1)) {
                shown.points.push(status.point());
            }
            shown.statuses += 1;
            if shown.points.len() >= MOST_POINTS {
                shown.points = shown.points.iter().copied().step_by(2).collect();
                shown.stride = 2 * shown.stride.max(1);
            }
        });
    }

    fn change(&self, change: impl FnOnce(&mut Shown, u64)) {
        let mut shown = lock(&self.shown);
        shown.change += 1;
        let now = shown.change;
        change(&mut shown, now);
        drop(shown);
        self.changes.send_replace(now);
    }

    /// What has changed since change number `since`; 0 for all.
    pub(crate) fn news(&self, since: u64) -> News {
        let shown = lock(&self.shown);
        let mut news = News { change: shown.change, ..News::default() };
        let newer = |part: &(u64, String)| (part.0 > since).then(|| part.1.clone());
        if let Some(hello) = newer(&shown.hello) {
            news.texts.push(hello);
            news.texts.push(protocol::text(&protocol::Curves::of(&shown.points)));
        }
        news.texts.extend(newer(&shown.status));
        news.records.extend(messages(Kind::Geometry, &shown.geometry, since));
        if shown.places.0 > since {
            news.records.extend(messages(Kind::Places, std::slice::from_ref(&shown.places), since));
        }
        news.records.extend(messages(Kind::Light, &shown.light, since));
        news
    }

    /// Hears of changes.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Counts a watcher, until what is returned goes away; none if there are `most` already.
    pub(crate) fn enter(self: &Arc<Stage>, most: usize) -> Option<Watcher> {
        let entered = self.watchers.fetch_update(Ordering::AcqRel, Ordering::Acquire, |n| (n < most).then_some(n + 1));
        entered.ok().map(|_| Watcher(self.clone()))
    }

    /// How many watch.
    pub fn watchers(&self) -> usize {
        self.watchers.load(Ordering::Acquire)
    }

    /// Whether a watcher wants the solver to wait. Nobody has to come back for it: a pause ends a while after the last
    /// watcher has gone.
    pub fn paused(&self) -> bool {
        if self.watchers() == 0 && lock(&self.left).is_some_and(|left| left.elapsed() > ABSENCE) {
            self.pause(false);
        }
        self.paused.load(Ordering::Acquire)
    }

    /// Whether a watcher wants the solver to stop.
    pub fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Acquire)
    }

    pub(crate) fn pause(&self, paused: bool) {
        self.paused.store(paused, Ordering::Release);
    }

    pub(crate) fn stop(&self) {
        self.stopped.store(true, Ordering::Release);
    }

    /// Nothing more will change.
    pub(crate) fn end(&self) {
        self.ended.store(true, Ordering::Release);
        lock(&self.wishes).clear();
        self.changes.send_modify(|_| ());
    }

    pub(crate) fn ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    /// An image.
    pub(crate) fn image(&self, number: usize) -> Option<Image> {
        lock(&self.images).get(number)?.clone()
    }

    /// Asks for a lit model.
    pub(crate) fn wish(&self) -> oneshot::Receiver<Model> {
        let (sender, receiver) = oneshot::channel();
        lock(&self.wishes).push(sender);
        receiver
    }

    /// Whether a watcher waits for a lit model.
    pub fn wants_model(&self) -> bool {
        let mut wishes = lock(&self.wishes);
        wishes.retain(|wish| !wish.is_closed());
        !wishes.is_empty()
    }

    /// Those who wait for a lit model from now on wait for this one.
    pub fn promise(&self) -> Promise {
        Promise(std::mem::take(&mut lock(&self.wishes)))
    }
}

/// A lit model that is being made.
pub struct Promise(Vec<oneshot::Sender<Model>>);

impl Promise {
    /// Hands it to all who wait for it.
    pub fn keep(self, model: Result<Vec<u8>, String>) {
        let model = model.map(Bytes::from);
        for wish in self.0 {
            wish.send(model.clone()).ok();
        }
    }
}

/// A watcher, as long as it watches.
pub(crate) struct Watcher(Arc<Stage>);

impl Drop for Watcher {
    fn drop(&mut self) {
        *lock(&self.0.left) = Some(Instant::now());
        self.0.watchers.fetch_sub(1, Ordering::AcqRel);
        self.0.changes.send_modify(|_| ());
    }
}

fn replace(parts: &mut [(u64, Bytes)], now: u64, records: Vec<(u32, Vec<u8>)>) {
    for (cluster, record) in records {
        if let Some(part) = parts.get_mut(cluster as usize) {
            *part = (now, record.into());
        }
    }
}

/// Messages with the records that are newer than `since`.
fn messages(kind: Kind, records: &[(u64, Bytes)], since: u64) -> Vec<Bytes> {
    let mut messages = Vec::new();
    let mut message = kind.begin();
    for (_, record) in records.iter().filter(|(change, record)| *change > since && !record.is_empty()) {
        if message.len() > size_of::<u32>() && message.len() + record.len() > MESSAGE {
            messages.push(std::mem::replace(&mut message, kind.begin()).into());
        }
        message.extend_from_slice(record);
    }
    if message.len() > size_of::<u32>() {
        messages.push(message.into());
    }
    messages
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_client_gets_the_latest_state_once() {
        let stage = Stage::default();
        stage.begin(&Hello::default(), Vec::new(), vec![vec![1; 8], vec![2; 8]]);
        for brightness in 3..9 {
            stage.light(vec![(1, vec![brightness; 4])]);
        }
        let all = stage.news(0);
        assert_eq!(all.texts.len(), 2);
        let bodies: Vec<&[u8]> = all.records.iter().map(|message| &message[4..]).collect();
        assert_eq!(bodies, [&[[1; 8], [2; 8]].concat()[..], &[8; 4]]);
        assert!(stage.news(all.change).records.is_empty());
        stage.light(vec![(0, vec![7; 4])]);
        assert_eq!(stage.news(all.change).records.len(), 1);
        // Light of elements that are no more is not shown.
        stage.reshape(vec![(0, vec![5; 12]), (1, vec![6; 12])]);
        stage.light(vec![(1, vec![9; 4])]);
        for since in [0, all.change] {
            let records = stage.news(since).records;
            let bodies: Vec<&[u8]> = records.iter().map(|message| &message[4..]).collect();
            assert_eq!(bodies, [&[[5; 12], [6; 12]].concat()[..], &[9; 4]]);
        }
    }

    #[test]
    fn large_states_come_in_several_messages() {
        let records: Vec<(u64, Bytes)> = (0..5).map(|k| (1, vec![k; MESSAGE / 2].into())).collect();
        let messages = messages(Kind::Light, &records, 0);
        assert_eq!(messages.len(), 5);
        assert!(messages.iter().all(|m| m.len() <= MESSAGE + 4));
    }

    #[test]
    fn curves_stay_short() {
        let stage = Stage::default();
        for shots in 0..10_000 {
            stage.status(&Status { shots, ..Status::default() });
        }
        let shown = lock(&stage.shown);
        assert!(shown.points.len() < MOST_POINTS && shown.points.len() > MOST_POINTS / 4);
        assert_eq!(shown.points[0][..3], Status::default().point()[..3]);
        assert!(shown.points.last().unwrap()[1] > 9_900.0);
    }

    #[test]
    fn no_more_watch_than_may() {
        let stage = Arc::new(Stage::default());
        let first = stage.enter(2);
        let second = stage.enter(2);
        assert!(first.is_some() && second.is_some() && stage.enter(2).is_none());
        drop(first);
        assert!(stage.watchers() == 1 && stage.enter(2).is_some());
    }
    #[test]
    fn a_pause_that_nobody_watches_ends() {
        let stage = Arc::new(Stage::default());
        let watcher = stage.enter(1);
        stage.pause(true);
        assert!(stage.paused());
        drop(watcher);
        assert!(stage.paused());
        *lock(&stage.left) = Instant::now().checked_sub(2 * ABSENCE);
        let watcher = stage.enter(1);
        assert!(stage.paused());
        drop(watcher);
        *lock(&stage.left) = Instant::now().checked_sub(2 * ABSENCE);
        assert!(!stage.paused());
    }
}
