# What happens in the guest: a machine of three axes on a virtual bus, with classic frames and with those of CAN FD.
#
# say NAME VERB ... runs a verb, keeps its object as NAME.json, and its exit status as NAME.status.
say() {
    name=$tag-$1
    shift
    echo "$name: $*"
    feedspline "$@" --bus $bus $fd --json > /out/$name.json 2> /out/$name.err
    echo $? > /out/$name.status
}

# begin NAME: the job goes on in the background, as process $playing; finish waits for its end.
begin() {
    job=$tag-$1
    echo "$job: stream"
    feedspline stream /part.ngc --bus $bus $fd --json > /out/$job.json 2> /out/$job.err &
    playing=$!
    sleep 4
}

finish() {
    wait $playing
    echo $? > /out/$job.status
}

session() {
    bus=$1 tag=$2 fd=$3
    candump -L $bus > /out/$tag.log &
    dump=$!
    say drives drive --node 1 --machine /machine.toml &
    drives=$!
    sleep 2
    say who status
    say whole stream /part.ngc
    say end status

    say home-1 home
    begin held
    say hold hold
    say at-hold status
    say slower resume --percent 50
    sleep 1
    say faster resume
    finish
    say after-hold status

    say home-2 home
    begin killed
    kill -KILL $playing
    finish
    sleep 1
    say after-kill status

    say home-3 home
    begin stopped
    # On the path, from any CAN tool.
    cansend $bus 010#00
    finish
    sleep 1
    say after-stop status

    say home-4 home
    begin quick
    # A reset of CANopen's network management, to all.
    cansend $bus 000#8100
    finish
    sleep 1
    say after-quick status

    say home-5 home
    begin unplugged
    ip link set $bus down
    finish
    wait $drives
    ip link set $bus up
    # It may have ended with its bus.
    kill $dump 2> /dev/null
    feedspline bus /out/$tag.log --json > /out/$tag-log.json 2> /out/$tag-log.err
    echo $? > /out/$tag-log.status
}

session vcan0 classic ""
session vcan1 fd --fd
