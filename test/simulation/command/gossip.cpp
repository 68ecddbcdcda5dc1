// SPDX-License-Identifier: BSL-1.0
// Measures gossip among many nodes in virtual time, and tells what it came to (README.md of the folder above).
#include "simulation/gossip_network.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::simulation;
using namespace std::chrono_literals;
using std::chrono::milliseconds;

constexpr std::string_view usage = R"(usage: cles_gossip_simulation [options]
  --nodes N     how many (1000)
  --minutes M   how long, with 5 % of packets lost and each process stopped for 2 % of the time (30)
  --seed S      of chance (1)
  --only PART   start, short-cut, long-cut or weather (all of them)
)";

struct options {
    std::size_t nodes = 1000;
    std::size_t minutes = 30;
    std::uint64_t seed = 1;
    std::string only{};

    [[nodiscard]] bool wants(std::string_view part) const { return only.empty() || only == part; }
};

constexpr std::string_view parts[] = {"start", "short-cut", "long-cut", "weather"};

std::size_t number(std::string_view text) {
    std::size_t value = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failed != std::errc{} || end != text.data() + text.size()) {
        throw std::runtime_error{"'" + std::string{text} + "' is no number"};
    }
    return value;
}

options read(const std::vector<std::string>& words) {
    options o;
    for (std::size_t i = 0; i + 1 < words.size(); i += 2) {
        if (words[i] == "--nodes") {
            o.nodes = number(words[i + 1]);
        } else if (words[i] == "--minutes") {
            o.minutes = number(words[i + 1]);
        } else if (words[i] == "--seed") {
            o.seed = number(words[i + 1]);
        } else if (words[i] == "--only") {
            o.only = words[i + 1];
            if (std::find(std::begin(parts), std::end(parts), o.only) == std::end(parts)) {
                throw std::runtime_error{"there is no part '" + o.only + "'"};
            }
        } else {
            throw std::runtime_error{"unknown option " + words[i]};
        }
    }
    if (words.size() % 2 != 0) {
        throw std::runtime_error{words.back() + " wants a value"};
    }
    return o;
}

int breaches = 0;

void tell(const char* what, double measured, double most, const char* unit) {
    const bool good = measured <= most;
    breaches += good ? 0 : 1;
    std::printf("%-58s %10.1f %-5s (at most %.1f)%s\n", what, measured, unit, most, good ? "" : "  BROKEN");
    std::fflush(stdout);
}

double seconds(milliseconds t) { return std::chrono::duration<double>(t).count(); }

void cold_start_and_calm(const options& o) {
    gossip_network net{o.seed};
    net.start(o.nodes, 1s);
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell("tables whole after the last node's cold start", seconds(whole), 15, "s");
    tell("  live nodes taken for gone meanwhile", static_cast<double>(net.false_deaths()), 0, "");
    net.pass(60s);
    net.take_received(1s);
    net.pass(60s);
    const auto bytes = net.take_received(60s);
    tell("received per node, steady: on average", bytes.average / 1000, 20, "kB/s");
    tell("  of the node that received the most", bytes.most / 1000, 40, "kB/s");
    // A suspicion passes with the next word and costs little: the node is still asked by name. Most are of the start,
    // when all know few and so expect to hear often.
    const auto pairs = static_cast<double>(o.nodes * (o.nodes - 1));
    tell("  live nodes suspected since the start, of 10,000 pairs",
         static_cast<double>(net.false_suspicions()) * 1e4 / pairs, 1, "");
}

void partition(const options& o, milliseconds lasts, const char* what) {
    gossip_network net{o.seed + 1};
    net.start(o.nodes, 1s);
    net.pass(30s);
    net.allow([](std::size_t from, std::size_t to) { return from % 2 == to % 2; });
    net.pass(lasts);
    net.allow({});
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell(what, seconds(whole), 15, "s");
}

void rough_weather(const options& o) {
    gossip_network net{o.seed + 2, {.loss = 50, .paused = 20}};
    net.start(o.nodes, 1s);
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell("whole after a cold start, 5 % loss, 2 % stopped", seconds(whole), 15, "s");
    for (std::size_t minute = 1; minute <= o.minutes; ++minute) {
        net.take_received(1s);
        net.pass(60s);
        const auto bytes = net.take_received(60s);
        std::printf(
            "  minute %zu: %.1f kB/s received, live nodes taken for gone %zu, suspected %zu, pairs missing %zu\n",
            minute, bytes.average / 1000, net.false_deaths(), net.false_suspicions(), net.missing());
        std::fflush(stdout);
    }
    tell("live nodes taken for gone in all that time", static_cast<double>(net.false_deaths()), 0, "");
    tell("clashes reported", static_cast<double>(net.clashes()), 0, "");
}

} // namespace

int main(int argc, char** argv) {
    try {
        const auto o = read({argv + 1, argv + argc});
        if (o.wants("start")) {
            cold_start_and_calm(o);
        }
        if (o.wants("short-cut")) {
            partition(o, 30s, "whole after a cut of 30 s");
        }
        if (o.wants("long-cut")) {
            partition(o, milliseconds{200} * static_cast<int>(o.nodes) + 30s,
                      "whole after a cut for longer than nodes are remembered");
        }
        if (o.wants("weather")) {
            rough_weather(o);
        }
        return breaches == 0 ? 0 : 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles_gossip_simulation: %s\n%s", e.what(), usage.data());
        return 2;
    }
}
