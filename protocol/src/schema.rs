//! The name of everything that goes over the wire: host and drives with different hashes do not talk.

use crate::checksum::Fnv64;

/// All messages and streams in their order on the wire. Whoever changes one of them changes this text.
pub const SCHEMA: &str = "\
TableHeader{version u8,table u32,spans u32,geometry_spans u32,step_exponent i8,q_scale f32,tick_ns u32,\
geometry_bytes u32,span_bytes u32,margin u8,warp ?Warp,joint ?Joint,tail ?u32}\
Joint{table u32,step u32,code u32,lengths [u32;2]}\
Warp{rate u32,acceleration u32,jerk u32,slope u64,bend u64}\
AxisHeader{table u32,axis u8,fraction_bits u8,start i64,end i64,limits Limits,control_bytes u32}\
Limits{velocity f32,acceleration f32,jerk ?f32}\
geometry{length<<1|more,spans-2}span{step,code dd u24}control{point dd i64}\
Part[Shared,Axis]\
HostMessage[Open TableHeader,OpenAxis AxisHeader,\
Seal{table u32,part Part,crc u32},Start{table u32,tick u64},Stop,Identify,QuickStop,MoveTo{position i64,velocity ?f32},\
MoveAt{velocity f32},Power PowerEvent,Override{permille u16,tick u64,number u8},Alive,\
Begin{boot u32,members u128},Report,Signed{counter u64,tag u64,message [u8]},Update Update]\
Update[Ask,Begin{bytes u32,hash [u8;32]},Data{offset u32,bytes [u8]},Try,Keep]\
DriveMessage[Ready{table u32,ticks u64,crc [u32;2]},Reject{table u32,reason Reject},Status,Identity,Telemetry,\
Missing{table u32,part Part,gaps [(u32,u32);8]},Begun{epoch u16},Update Progress]\
Progress[None,Receiving{next u32},Verifying{read u32},Verified,Restarting,Trial]\
Status{state State,power Power,fault ?Fault,tick u64,position i64,fill u64}\
Identity{version [u8;3],format u8,schema u64,axis u8,tick_ns u32,limits Limits,room u32,boot u32,epoch u16}\
Telemetry{ticks u32,following_max u32,following_rms f32,fill_ms u32,worst_tick u32}\
State[Idle,Receiving,Ready,Armed,Running,Holding,Held,Stopping,Moving]\
Fault[Table{table u32,error TableError},Limit AxisLimit,Connection,Board{code u16}]\
Power[SwitchOnDisabled,ReadyToSwitchOn,SwitchedOn,OperationEnabled,QuickStopActive,FaultReactionActive,Fault]\
PowerEvent[Shutdown,SwitchOn,EnableOperation,DisableOperation,DisableVoltage,QuickStop,ResetFault,Fault,Stopped]\
Reject[Table TableError,Checksum Part,NoRoom{needed u64,available u64},\
Tick{tick_ns u32},Axis{axis u8},Limits,Position{position i64},Busy,NotOpen,NotReady,Late{tick u64},\
Overlap{tick u64},Fault,Target,Power Power,Moves,Override,Joint,Epoch{epoch u16},Boot,Clock,Members,Key,Update UpdateFault]\
UpdateFault[Unable,Powered,Size{room u32},Hash,Memory,Order]\
Stream[Geometry,Spans,Controls]\
HeaderField[Version,Table,Spans,GeometrySpans,StepExponent,QScale,Tick,Length,FractionBits,Limits,Margin,Warp,Joint,Tail]\
TableError[Header HeaderField,Truncated{stream,index u32},Malformed{stream,index u32},\
Range{stream,index u32},LeftOver{stream},Overfull{index u32},Count{stream},Bend{index u32},Slow{index u32},\
Fast{index u32},ControlStep{index u32},Start,End,Limit{limit AxisLimit,index u32}]\
AxisLimit[Velocity,Acceleration,Jerk,Travel]\
block{length u16,epoch u16,message,crc32c u32}frame{first 1,last 1,number 6}\
data{tag 4,unit 20,bytes}beat{state 4,power 3,open 1,fault 1,synced 1,stopping 1,_ 1,free 2,_ 2,committed u8,epoch u8,\
residual_us i8,fill_ms u16,change u8}sync{counter u8}time{counter u8,tick u32,ns u24}stop{kind u8,tick ?u32}\
emergency{code u16,register u8,cause u8,tick u32}";

/// FNV-1a hash of [`SCHEMA`].
pub const HASH: u64 = Fnv64::new().with(SCHEMA.as_bytes()).finish();
