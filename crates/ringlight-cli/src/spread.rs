//! How a solve is spread over ranks: the number of rings that memory allows.

use crate::arguments::{RoutingChoice, ShardsChoice, SpreadArguments};
use crate::failure::Failure;
use crate::launch::{COMMAND, ranks_with_the_same};
use crate::machine::{self, MemoryLeft};
use crate::run::Settings;
use crate::values::RingsChoice;
use anyhow::anyhow;
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
        _ => Ok(()),
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

/// The rings, and the memory that each rank needs at most, bytes. An error if that is more than there is; the same on all
/// ranks.
pub fn choose(
    arguments: &SpreadArguments,
    demand: Demand,
    ranks: &mut Communicator<'_>,
) -> Result<(Rings, u64), Failure> {
    let size = ranks.size();
    let Spread { window, packet_size, .. } = spread(arguments, Rings::one(size));
    let demand = demand.with_packets(window, packet_size, OUTLINE);
    let available = match arguments.memory_per_rank {
        Some(bytes) => bytes,
        None => share_of_what_is_left(ranks, machine::memory_left())?,
    };
    let fitting = demand.most_rings(size, available);
    let rings = match arguments.rings {
        RingsChoice::Auto => fitting,
        RingsChoice::Number(rings) => Rings::new(size, rings).filter(|rings| demand.of_a_rank(*rings) <= available),
    };
    if let Some(rings) = rings {
        return Ok((rings, demand.of_a_rank(rings)));
    }
    let asked = match arguments.rings {
        RingsChoice::Auto => 1,
        RingsChoice::Number(rings) => rings,
    };
    let needed = Rings::new(size, asked).map_or(u64::MAX, |rings| demand.of_a_rank(rings));
    let way_out = match (fitting, demand.fewest_ranks(available)) {
        (Some(rings), _) => format!("--rings {} would do", rings.rings()),
        (None, Some(fewest)) => format!("{fewest} ranks in one ring would do"),
        (None, None) => "no number of ranks would do".into(),
    };
    let limit =
        if arguments.memory_per_rank.is_some() { "" } else { " (what is left here; --memory-per-rank says otherwise)" };
    let (needed, available) = (in_words(needed), in_words(available));
    Err(anyhow!("each rank needs about {needed} of memory, and may use {available}{limit}; {way_out}").into())
}

/// This rank's share of what the system has left, or the share of the rank that has least.
fn share_of_what_is_left(ranks: &mut Communicator<'_>, left: MemoryLeft) -> Result<u64, transport::Failure> {
    let here = ranks_with_the_same(ranks, &machine::host())? as u64;
    let in_process = ranks_with_the_same(ranks, &format!("{} {}", machine::host(), std::process::id()))? as u64;
    let share = |left: Option<u64>, among: u64| left.map_or(u64::MAX, |bytes| bytes / among);
    let own = share(left.together, here).min(share(left.process, in_process));
    let least = |a: [u8; 8], b: [u8; 8]| u64::from_le_bytes(a).min(u64::from_le_bytes(b)).to_le_bytes();
    Ok(u64::from_le_bytes(ranks.all_reduce(COMMAND, own.to_le_bytes(), least)?))
}

/// Settings as the report shows them.
pub fn settings(arguments: &SpreadArguments, rings: Rings) -> Settings {
    let SpreadArguments { memory_per_rank, shards, routing, .. } = *arguments;
    Settings::from_iter([
        ("threads".into(), rayon::current_num_threads().into()),
        ("ranks".into(), rings.ranks().into()),
        ("rings".into(), rings.rings().into()),
        ("memory_per_rank".into(), memory_per_rank.into()),
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

    fn arguments(rings: RingsChoice, memory_per_rank: Option<u64>) -> SpreadArguments {
        let (shards, routing) = (ShardsChoice::Spatial, RoutingChoice::Boxes);
        SpreadArguments { ranks: None, rings, memory_per_rank, packet_size: None, shards, routing }
    }

    /// With so many GiB for each rank, and some for packets.
    fn chosen(size: usize, rings: RingsChoice, memory: u64) -> Result<usize, String> {
        let demand = Demand { owned: 8 << 30, triangles: 16 << 30, held: 1, ..Demand::default() };
        let memory = Some((memory << 30) + (32 << 20));
        let choice = |ranks: &mut Communicator<'_>| choose(&arguments(rings, memory), demand, ranks);
        let all = threads::run(size, choice).map_err(|failure| failure.to_string())?;
        assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
        Ok(all[0].0.rings())
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
    fn ranks_of_one_process_share_what_is_left() {
        let left = MemoryLeft { together: Some(900), process: Some(600) };
        let shares = threads::run(3, |ranks| share_of_what_is_left(ranks, left)).unwrap();
        assert_eq!(shares, [200; 3]);
    }

    #[test]
    fn more_rings_than_ranks_make_no_sense() {
        assert!(check(&arguments(RingsChoice::Number(3), None), 3).is_ok());
        assert!(check(&arguments(RingsChoice::Number(2), None), 1).is_err_and(|f| f.code() == 2));
        assert!(check(&arguments(RingsChoice::Auto, None), 1).is_ok());
    }
}
