// SPDX-License-Identifier: BSL-1.0
// Parsing of the kernel's files, from samples of them.
#include "system/cpu_use.hpp"
#include "system/disk.hpp"
#include "system/load.hpp"
#include "system/memory.hpp"
#include "system/network.hpp"
#include "system/processes.hpp"
#include "system/utc.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

using namespace std::chrono_literals;

BOOST_AUTO_TEST_SUITE(kernel_files)

BOOST_AUTO_TEST_CASE(utc_is_seconds_and_text) {
    const auto now = sysinfo::utc_at(1'700'000'000'123'456'789);
    BOOST_TEST(now.seconds == 1'700'000'000.123456);
    BOOST_TEST(now.text == "2023-11-14T22:13:20.123456Z");
    BOOST_TEST(sysinfo::utc_at(0).text == "1970-01-01T00:00:00.000000Z");
    BOOST_TEST(sysinfo::utc_at(-1'000'000'000).text == "1969-12-31T23:59:59.000000Z");
    BOOST_TEST(sysinfo::utc_at(1'709'210'096'000'000'000).text == "2024-02-29T12:34:56.000000Z");
}

BOOST_AUTO_TEST_CASE(load_is_read) {
    const auto l = sysinfo::parse_load("0.20 1.18 12.12 3/380 11206\n");
    BOOST_TEST(l.one_minute == 0.20);
    BOOST_TEST(l.five_minutes == 1.18);
    BOOST_TEST(l.fifteen_minutes == 12.12);
    BOOST_TEST(l.running == 3U);
    BOOST_TEST(l.threads == 380U);
}

BOOST_AUTO_TEST_CASE(cpu_times_are_read_with_what_waits_for_a_disk_as_idle) {
    const auto t = sysinfo::parse_cpu_times("cpu  100 20 30 800 50 5 6 7 40 0\ncpu0 1 2 3 4 5 6 7 8 9 10\n");
    BOOST_TEST(t.busy == 168U);
    BOOST_TEST(t.all == 1018U);
}

BOOST_AUTO_TEST_CASE(use_of_the_cores_is_what_was_between_two_readings_that_lie_apart) {
    sysinfo::cpu_use use;
    const cles::time_point start{1h};
    BOOST_TEST(use.take({.busy = 250, .all = 1000}, start) == 0.25); // since the machine started
    BOOST_TEST(use.take({.busy = 260, .all = 1010}, start + 10ms) == 260.0 / 1010);
    BOOST_TEST(use.take({.busy = 350, .all = 1200}, start + 200ms) == 0.5);
    // Soon after: still relative to the reading before.
    BOOST_TEST(use.take({.busy = 351, .all = 1201}, start + 210ms) == 101.0 / 201);
    BOOST_TEST(use.take({.busy = 350, .all = 1300}, start + 400ms) == 0);
    BOOST_TEST(use.take({.busy = 340, .all = 1400}, start + 600ms) == 0); // some kernels count backwards
    BOOST_TEST(use.take({.busy = 340, .all = 1400}, start + 800ms) == 0);
}

BOOST_AUTO_TEST_CASE(memory_is_in_bytes) {
    const auto m =
        sysinfo::parse_memory("MemTotal:       16384 kB\nMemFree:          100 kB\nMemAvailable:    8000 kB\n"
                              "Buffers:            1 kB\nCached:           200 kB\nSwapCached:         9 kB\n"
                              "SwapTotal:       2048 kB\nSwapFree:        2047 kB\nHugePages_Total:   0\n");
    BOOST_TEST(m.total == 16384U * 1024);
    BOOST_TEST(m.free == 100U * 1024);
    BOOST_TEST(m.available == 8000U * 1024);
    BOOST_TEST(m.buffers == 1024U);
    BOOST_TEST(m.cached == 200U * 1024);
    BOOST_TEST(m.swap_total == 2048U * 1024);
    BOOST_TEST(m.swap_free == 2047U * 1024);
}

BOOST_AUTO_TEST_CASE(file_systems_are_those_on_devices_and_the_root_each_once) {
    const auto all = sysinfo::parse_mounts("overlay / overlay rw 0 0\nproc /proc proc rw 0 0\n"
                                           "/dev/sda1 /data\\040two ext4 rw 0 0\n/dev/sda1 /again ext4 rw 0 0\n"
                                           "tmpfs /run tmpfs rw 0 0\n/dev/sdb /b\\134 vfat ro 0 0\nshort\n");
    BOOST_REQUIRE(all.size() == 3U);
    BOOST_TEST(all[0].mount == "/");
    BOOST_TEST(all[0].type == "overlay");
    BOOST_TEST(all[1].mount == "/data two");
    BOOST_TEST(all[1].device == "/dev/sda1");
    BOOST_TEST(all[2].mount == "/b\\");
}

BOOST_AUTO_TEST_CASE(disks_are_counted_whole_and_in_bytes) {
    const auto all =
        sysinfo::parse_disk_traffic("   7       0 loop0 0 0 0 0 0 0 0 0 0 0 0\n"
                                    "   8       0 sda 5120 120 1000 900 700 80 200 300 0 1100 1200 0 0 0 0\n"
                                    "   8       1 sda1 5000 120 900 900 700 80 200 300 0 1100 1200 0 0 0 0\n"
                                    " 259       0 nvme0n1 1 0 8 0 1 0 16 0 0 5 5\n"
                                    " 259       1 nvme0n1p1 1 0 8 0 1 0 16 0 0 5 5\n"
                                    " 259       2 nvme0n12 1 0 8 0 1 0 16 0 0 5 5\n");
    BOOST_REQUIRE(all.size() == 3U);
    BOOST_TEST(all[0].device == "sda");
    BOOST_TEST(all[0].read == 512'000U);
    BOOST_TEST(all[0].written == 102'400U);
    BOOST_TEST(all[0].busy_ms == 1100U);
    BOOST_TEST(all[1].device == "nvme0n1");
    BOOST_TEST(all[2].device == "nvme0n12");
}

BOOST_AUTO_TEST_CASE(interfaces_are_counted_in_both_directions) {
    const auto n =
        sysinfo::parse_network("Inter-|   Receive                                                |  Transmit\n"
                               " face |bytes    packets errs drop fifo frame compressed multicast|bytes    packets "
                               "errs drop fifo colls carrier "
                               "compressed\n"
                               "    lo: 1000 10 0 0 0 0 0 0 1000 10 0 0 0 0 0 0\n"
                               "eth0:1:2000 20 1 2 0 0 0 5 3000 30 3 4 0 0 0 0\n");
    BOOST_REQUIRE(n.interfaces.size() == 2U);
    BOOST_TEST(n.interfaces[0].name == "lo");
    BOOST_TEST(n.interfaces[0].received.bytes == 1000U);
    const auto& alias = n.interfaces[1];
    BOOST_TEST(alias.name == "eth0:1");
    BOOST_TEST(alias.received.packets == 20U);
    BOOST_TEST(alias.received.errors == 1U);
    BOOST_TEST(alias.received.dropped == 2U);
    BOOST_TEST(alias.sent.bytes == 3000U);
    BOOST_TEST(alias.sent.packets == 30U);
    BOOST_TEST(alias.sent.errors == 3U);
    BOOST_TEST(alias.sent.dropped == 4U);
}

BOOST_AUTO_TEST_CASE(a_process_with_any_name_is_parsed) {
    const auto p =
        sysinfo::parse_process("42 (a (b) c) S 1 42 42 0 -1 4194560 100 200 300 400 150 50 11 12 20 0 7 0 12345 "
                               "1000000 250 18446744073709551615 1 1\n",
                               {.ticks_per_second = 100, .page = 4096});
    BOOST_REQUIRE(p.has_value());
    BOOST_TEST(p->pid == 42);
    BOOST_TEST(p->name == "a (b) c");
    BOOST_TEST(p->state == "S");
    BOOST_TEST(p->cpu_ms == 2000U);
    BOOST_TEST(p->threads == 7U);
    BOOST_TEST(p->memory == 250U * 4096);
}

BOOST_AUTO_TEST_CASE(files_of_another_format_are_harmless) {
    for (const std::string_view text :
         {"", "\n", "42", "42 (a", "42 )a(", "42 (a) ", "\xFF\xFE:::", ":", "a:b", "/dev/"}) {
        BOOST_TEST(!sysinfo::parse_process(text, {}).has_value());
        sysinfo::parse_load(text);
        sysinfo::parse_memory(text);
        sysinfo::parse_mounts(text);
        sysinfo::parse_disk_traffic(text);
        sysinfo::parse_network(text);
        sysinfo::parse_cpu_times(text);
    }
}

BOOST_AUTO_TEST_CASE(the_largest_processes_are_listed) {
    std::vector<sysinfo::process> all;
    for (int i = 1; i <= 5; ++i) {
        all.push_back({.pid = i, .name = "p", .state = "S", .threads = 2, .cpu_ms = 0, .memory = i == 4 ? 1000U : 10U});
    }
    const auto sum = sysinfo::summed_up(all, 2);
    BOOST_TEST(sum.count == 5U);
    BOOST_TEST(sum.threads == 10U);
    BOOST_REQUIRE(sum.largest.size() == 2U);
    BOOST_TEST(sum.largest[0].pid == 4);
    BOOST_TEST(sum.largest[1].pid == 1);
    BOOST_TEST(sysinfo::summed_up(all, 100).largest.size() == 5U);
}

BOOST_AUTO_TEST_SUITE_END()
