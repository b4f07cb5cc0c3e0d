//! Types and bytes that the planner, the bus and the drives agree on. No motion mathematics.
//!
//! [`table`] is the feed table on the wire: headers, the bounded streams behind them and the rules every table
//! obeys. [`message`] is what host and drives say to each other; [`bus`] cuts it into CAN frames and puts it
//! together again; [`authentic`] has the key that a drive may ask for. [`update`] brings a drive a new image. [`power`] has the states in which they follow. [`schema`] names the version of all of it. Everything works on borrowed bytes, without
//! allocation, and answers every input with a value or a named error.
#![no_std]

pub mod authentic;
pub mod bus;
pub mod checksum;
pub mod message;
pub mod power;
pub mod schema;
pub mod table;
pub mod update;
pub mod varint;
