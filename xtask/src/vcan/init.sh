#!/bin/busybox sh
# The first process of the guest: two virtual buses, the session, what came of it on the third serial line, the end.
/bin/busybox mkdir -p /proc /sys /dev /out /tmp
/bin/busybox mount -t devtmpfs none /dev
/bin/busybox mount -t proc none /proc
/bin/busybox mount -t sysfs none /sys
/bin/busybox --install -s /bin
export PATH=/bin TERM=dumb
stty raw -echo < /dev/ttyS1
stty raw -echo < /dev/ttyS2
for module in can can-raw can-dev vcan; do
    insmod "/modules/$module.ko"
done
for bus in vcan0 vcan1; do
    ip link add dev $bus type vcan
    ip link set $bus mtu 72
    ip link set $bus up
done
cd /
sh /session.sh > /dev/ttyS1 2>&1 < /dev/null
tar -c -f - -C /out . | gzip -1 > /dev/ttyS2
sync
echo "the guest has ended" > /dev/ttyS0
poweroff -f
