#!/bin/sh
# Fetches a kernel that has CAN, and leaves its image and a few of its modules in the folder $1. Nothing is installed.
set -eu
modules="can can-raw can-dev vcan"
cd "$1"
[ -s vmlinux ] && [ -s vcan.ko ] && exit 0
package=$(apt-cache depends linux-image-amd64 | sed -n 's/^ *Depends: //p' | head -n 1)
if [ -z "$package" ]; then
    echo "apt knows no linux-image-amd64" >&2
    exit 1
fi
rm -rf unpacked
mkdir unpacked
apt-get -q -o APT::Sandbox::User=root download "$package" >&2
dpkg-deb --extract "$package"_*.deb unpacked
rm "$package"_*.deb
for module in $modules; do
    found=$(find unpacked -name "$module.ko*" | head -n 1)
    case $found in
        *.xz) xz -dc "$found" > "$module.ko" ;;
        *) cp "$found" "$module.ko" ;;
    esac
done
# What is packed inside of the boot image is the kernel itself: an emulator boots it sooner than it would unpack itself.
image=$(find unpacked/boot -name 'vmlinuz-*' | head -n 1)
at=$(LC_ALL=C grep -aboP '\xfd7zXZ\x00' "$image" | head -n 1 | cut -d : -f 1)
tail -c "+$((at + 1))" "$image" | xz -dc --single-stream > unpacked/vmlinux || true
[ "$(head -c 4 unpacked/vmlinux | tail -c 3)" = ELF ]
mv unpacked/vmlinux vmlinux
rm -r unpacked
