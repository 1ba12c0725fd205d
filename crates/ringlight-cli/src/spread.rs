//! How a solve is spread over ranks: the number of rings that memory allows.

use crate::arguments::{RoutingChoice, ShardsChoice, SpreadArguments};
use crate::failure::Failure;
use crate::launch::{COMMAND, ranks_with_the_same};
use crate::machine::{self, MemoryLeft};
use crate::run::Settings;
use crate::values::RingsChoice;
use ringlight::ring::{Demand, Rings, Routing, Shards};
use ringlight::solve::{OUTLINE, Spread};
use ringlight::transport::{self, Communicator};

/// Says what is wrong with the number of rings asked for, before anything is read.
pub fn check(arguments: &SpreadArguments, ranks: usize) -> Result<(), Failure> {
    match arguments.rings {
        RingsChoice::Number(rings) if rings > ranks => {
            let given = if ranks == 1 { "there is 1 rank".into() } else { format!("there are {ranks} ranks") };
            Err(Failure::Usage(format!("--rings {rings}: {given}, and each ring needs one at least")))
        }
        _ => match arguments.memory_per_rank.len() {
            0 | 1 => Ok(()),
            given if given == ranks => Ok(()),
            given => Err(Failure::Usage(format!(
                "--memory-per-rank: {given} sizes for {ranks} ranks; give one, or one each"
            ))),
        },
    }
}

impl SpreadArguments {
    /// Whether the user says how much memory there is.
    pub fn is_bounded(&self) -> bool {
        !self.memory_per_rank.is_empty()
    }
}

/// How the work is spread over the ranks of these rings.
pub fn spread(arguments: &SpreadArguments, rings: Rings) -> Spread {
    let best = Spread::new(rings);
    let shards = match arguments.shards {
        ShardsChoice::Spatial => Shards::Spatial,
        ShardsChoice::Random => Shards::Random,
    };
    let routing = match arguments.routing {
        RoutingChoice::Boxes => Routing::Boxes,
        RoutingChoice::All => Routing::All,
    };
    Spread { shards, routing, packet_size: arguments.packet_size.unwrap_or(best.packet_size), ..best }
}

/// How ranks share memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The rings.
    pub rings: Rings,
    /// What each rank needs at most, bytes, if all own as much.
    pub needed: u64,
    /// For how many bytes each rank has room, of what all own together.
    pub rooms: Vec<u64>,
}

/// What each rank may use, bytes; the same on all ranks. To be asked before much is used.
pub fn available(arguments: &SpreadArguments, ranks: &mut Communicator<'_>) -> Result<Vec<u64>, transport::Failure> {
    match arguments.memory_per_rank[..] {
        [] => shares_of_what_is_left(ranks, machine::memory_left()),
        [bytes] => Ok(vec![bytes; ranks.size()]),
        _ => Ok(arguments.memory_per_rank.clone()),
    }
}

/// Chooses rings that what is [`available`] allows, or says why none do.
pub fn choose(arguments: &SpreadArguments, demand: Demand, available: &[u64]) -> Result<Choice, String> {
    let size = available.len();
    let Spread { window, packet_size, .. } = spread(arguments, Rings::one(size));
    let demand = demand.with_packets(window, packet_size, OUTLINE);
    let fitting = demand.most_rings(available);
    let rings = match arguments.rings {
        RingsChoice::Auto => fitting,
        RingsChoice::Number(rings) => Rings::new(size, rings),
    };
    if let Some((rings, rooms)) = rings.and_then(|rings| Some((rings, demand.rooms(rings, available)?))) {
        return Ok(Choice { rings, needed: demand.of_a_rank(rings), rooms });
    }
    let asked = match arguments.rings {
        RingsChoice::Auto => 1,
        RingsChoice::Number(rings) => rings,
    };
    let needed = in_words(Rings::new(size, asked).map_or(u64::MAX, |rings| demand.of_a_rank(rings)));
    let (least, most) = available.iter().fold((u64::MAX, 0), |(least, most), &b| (least.min(b), most.max(b)));
    let way_out = match (fitting, demand.fewest_ranks(least)) {
        (Some(rings), _) => format!("--rings {} would do", rings.rings()),
        (None, Some(fewest)) => format!("{fewest} ranks in one ring would do"),
        (None, None) => "no number of ranks would do".into(),
    };
    let limit = if arguments.is_bounded() { "" } else { " (what is left here; --memory-per-rank says otherwise)" };
    let available = match least == most {
        true => in_words(least),
        false => format!("{} to {}", in_words(least), in_words(most)),
    };
    Err(format!("each rank needs about {needed} of memory, and may use {available}{limit}; {way_out}"))
}

/// Every rank's share of what the system has left to it.
fn shares_of_what_is_left(ranks: &mut Communicator<'_>, left: MemoryLeft) -> Result<Vec<u64>, transport::Failure> {
    let here = ranks_with_the_same(ranks, &machine::host())? as u64;
    let in_process = ranks_with_the_same(ranks, &format!("{} {}", machine::host(), std::process::id()))? as u64;
    let share = |left: Option<u64>, among: u64| left.map_or(u64::MAX, |bytes| bytes / among);
    let own = share(left.together, here).min(share(left.process, in_process));
    let all = ranks.all_gather(COMMAND, own.to_le_bytes().to_vec())?;
    Ok(all.iter().flat_map(|bytes| bytes.first_chunk()).map(|&bytes| u64::from_le_bytes(bytes)).collect())
}

/// Settings as the report shows them.
pub fn settings(arguments: &SpreadArguments, rings: Rings) -> Settings {
    let SpreadArguments { memory_per_rank, shards, routing, .. } = arguments;
    let memory_per_rank = match memory_per_rank[..] {
        [] => None::<u64>.into(),
        [bytes] => bytes.into(),
        _ => memory_per_rank.as_slice().into(),
    };
    Settings::from_iter([
        ("threads".into(), rayon::current_num_threads().into()),
        ("ranks".into(), rings.ranks().into()),
        ("rings".into(), rings.rings().into()),
        ("memory_per_rank".into(), memory_per_rank),
        ("packet_size".into(), spread(arguments, rings).packet_size.into()),
        ("shards".into(), format!("{shards:?}").to_lowercase().into()),
        ("routing".into(), format!("{routing:?}").to_lowercase().into()),
    ])
}

/// Bytes in words.
pub fn in_words(bytes: u64) -> String {
    match bytes as f64 / f64::from(1 << 20) {
        mebibytes if mebibytes < 9.95 => format!("{mebibytes:.1} MiB"),
        mebibytes if mebibytes < 1023.5 => format!("{mebibytes:.0} MiB"),
        mebibytes => format!("{:.1} GiB", mebibytes / 1024.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringlight::transport::threads;

    fn arguments(rings: RingsChoice, memory_per_rank: &[u64]) -> SpreadArguments {
        let memory_per_rank = memory_per_rank.to_vec();
        let (shards, routing) = (ShardsChoice::Spatial, RoutingChoice::Boxes);
        SpreadArguments { ranks: None, rings, memory_per_rank, packet_size: None, shards, routing }
    }

    /// With so many GiB for each rank, and some for packets.
    fn chosen(size: usize, rings: RingsChoice, memory: u64) -> Result<usize, String> {
        let demand = Demand { owned: 8 << 30, triangles: 16 << 30, held: 1, ..Demand::default() };
        let memory = [(memory << 30) + (32 << 20)];
        let arguments = arguments(rings, &memory);
        let available = threads::run(size, |ranks| available(&arguments, ranks)).unwrap();
        assert!(available.iter().all(|of_rank| *of_rank == vec![memory[0]; size]));
        choose(&arguments, demand, &available[0]).map(|choice| choice.rings.rings())
    }

    #[test]
    fn as_many_rings_as_memory_allows() {
        assert_eq!(chosen(8, RingsChoice::Auto, 17), Ok(8));
        assert_eq!(chosen(8, RingsChoice::Auto, 10), Ok(4));
        assert_eq!(chosen(8, RingsChoice::Auto, 4), Ok(1));
        assert_eq!(chosen(8, RingsChoice::Number(2), 9), Ok(2));
    }

    #[test]
    fn what_does_not_fit_is_told_with_what_would_do() {
        let refused = chosen(1, RingsChoice::Auto, 2).unwrap_err();
        assert!(refused.contains("24.0 GiB") && refused.contains("may use 2.0 GiB"), "{refused}");
        assert!(refused.contains("13 ranks in one ring would do"), "{refused}");
        let refused = chosen(8, RingsChoice::Number(8), 10).unwrap_err();
        assert!(refused.contains("17.0 GiB") && refused.contains("--rings 4 would do"), "{refused}");
    }

    #[test]
    fn who_may_use_less_owns_less() {
        let demand = Demand { owned: 8 << 30, ..Demand::default() };
        let memory = [1, 5, 2, 0].map(|gib| gib << 30);
        let choice = choose(&arguments(RingsChoice::Number(4), &memory), demand, &memory);
        assert_eq!(choice.unwrap().rooms, memory);
    }

    #[test]
    fn ranks_of_one_process_share_what_is_left() {
        let left = MemoryLeft { together: Some(900), process: Some(600) };
        let shares = threads::run(3, |ranks| shares_of_what_is_left(ranks, left)).unwrap();
        assert_eq!(shares, [[200; 3]; 3]);
    }

    #[test]
    fn more_rings_than_ranks_make_no_sense() {
        assert!(check(&arguments(RingsChoice::Number(3), &[]), 3).is_ok());
        assert!(check(&arguments(RingsChoice::Number(2), &[]), 1).is_err_and(|f| f.code() == 2));
        assert!(check(&arguments(RingsChoice::Auto, &[]), 1).is_ok());
        assert!(check(&arguments(RingsChoice::Auto, &[1, 2, 3]), 3).is_ok());
        assert!(check(&arguments(RingsChoice::Auto, &[1, 2, 3]), 2).is_err_and(|f| f.code() == 2));
    }
}
