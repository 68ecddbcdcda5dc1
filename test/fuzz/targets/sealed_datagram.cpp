// SPDX-License-Identifier: BSL-1.0
// Sealed datagrams at one node, car1, while car2 talks to it: arbitrary ones, and such that are sealed correctly with
// arbitrary contents. The input is a series of steps: an operation (1 byte), the length of its argument (2 bytes,
// big-endian), and the argument:
//
//     0  a datagram arrives from one of four addresses (first byte)
//     1  the same from the multicast group
//     2  car2 sends a line                 3  car2 seals a line for the group
//     4  car1 sends a line                 5  begins a session; 6  checks its peer
//     7  car2 begins a session             8  car2 starts again, with this epoch, salt and counter
//     9  time passes (3 bytes: milliseconds)
//     a  a datagram that was sent before arrives (first byte: which), with a byte changed (2 bytes: where, and how)
//     b  the next roster comes into force: rotated, without car2, with car2 as a new member
//     c  what was sent is lost, or not any more
//
// For every input: car1 opens no line that car2 has not sealed for it, and none more often; nothing is answered that no
// member has sealed; what is kept is limited; without activity nothing is kept.
#include "fuzz/fuzz.hpp"
#include "fuzz/seeded_keys.hpp"
#include "security/datagrams/datagram_sessions.hpp"
#include "security/datagrams/group_receiver.hpp"
#include "security/datagrams/group_sender.hpp"
#include "security/fleet/fleet_authority.hpp"

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace cles::fuzz {
namespace {

using namespace cles::security;

constexpr std::size_t most_steps = 100;
constexpr std::size_t most_handshakes = 20; // they take the time

using bytes = std::vector<std::uint8_t>;

// The rosters that come into force, made once.
const std::vector<std::shared_ptr<const roster>>& rosters() {
    static const auto made = [] {
        std::vector<std::shared_ptr<const roster>> all;
        auto authority = fleet_authority::found(key_from(200));
        const auto keep = [&] { all.push_back(authority.share()); };
        authority.add({.name = "car1", .key = key_from(1).public_part()});
        authority.add({.name = "car2", .key = key_from(2).public_part()});
        keep();
        authority.rotate();
        keep();
        authority.remove("car2");
        keep();
        authority.add({.name = "car2", .key = key_from(2).public_part()});
        keep();
        return all;
    }();
    return made;
}

bytes_view bytes_of(std::string_view text) { return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}; }

constexpr auto at_car1 = datagram_path::v4(0x0a000001, 25370);
constexpr auto at_car2 = datagram_path::v4(0x0a000002, 25370);

class network;

class node final : public datagram_sink {
  public:
    node(network& net, int car, std::uint64_t seed, std::uint32_t epoch, std::uint64_t counter)
        : epoch_(epoch), net_(net), random_(seed),
          known("car" + std::to_string(car), key_from(static_cast<std::uint8_t>(car)), rosters().front()),
          group(known, random_, counter), receiver(known, group, random_), sessions(known, *this, random_, limits()) {}

    static datagram_limits limits() {
        datagram_limits small;
        small.sources_per_member = 3;
        small.waiting_bytes_in_all = 3000;
        small.rekey_datagrams = 30;
        return small;
    }
    [[nodiscard]] std::uint32_t number() const { return known.self() == nullptr ? 0 : known.self()->number; }

  private:
    const std::uint32_t epoch_;
    network& net_;
    seeded_entropy random_;

    void send(const datagram_path& to, bytes_view datagram) override;
    node_statement statement() override {
        return {.roster = known.in_force().version(),
                .epoch = epoch_,
                .salt = group.salt(),
                .counter = group.next_counter()};
    }
    void established(const datagram_source& with, const node_statement& stated, bool restarted) override;
    void opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) override;
    void gave_up(const datagram_source&, bool) override {}

  public:
    fleet known;
    group_sender group;
    group_receiver receiver;
    datagram_sessions sessions;
};

class network {
  public:
    network() { start_car2("e"); }

    void step(int operation, std::string_view argument) {
        const auto first = argument.empty() ? 0U : static_cast<std::uint8_t>(argument.front());
        const auto rest = bytes_of(argument.substr(argument.empty() ? 0 : 1));
        switch (operation) {
        case 0: arrive(path(first), rest); break;
        case 1: arrive_in_group(path(first), rest); break;
        case 2: talk(*car2_, {.path = at_car1, .member = car1_.number()}, argument); break;
        case 3: seal(argument); break;
        case 4: talk(car1_, peer(), argument); break;
        case 5: begin(car1_, peer()); break;
        case 6: check(first); break;
        case 7: begin(*car2_, {.path = at_car1, .member = car1_.number()}); break;
        case 8: start_car2(argument); break;
        case 9: pass(number(argument)); break;
        case 10: repeat(first, argument); break;
        case 11: next_roster(); break;
        case 12: lost_ = !lost_; break;
        default: break;
        }
        settle();
        require(car1_.sessions.sources() <= 6, "the sources of a member are limited");
        require(car1_.sessions.half_open() <= 1024, "sessions without DATA are limited");
        require(car1_.sessions.waiting() <= 3000, "what waits is limited");
    }

    /// Advances the time, while the other node is silent.
    void end() {
        lost_ = true;
        under_way_.clear();
        for (int minutes = 0; minutes < 45; ++minutes) {
            pass(60'000);
            under_way_.clear();
        }
        require(car1_.sessions.sources() == 0, "a silent source is forgotten");
        require(car1_.sessions.half_open() == 0, "sessions without DATA are forgotten");
        require(car1_.sessions.waiting() == 0, "nothing waits for ever");
        require(!car1_.sessions.next_deadline(), "no deadline is left");
    }

    // For the nodes.
    void carry(const node& by, const datagram_path& to, bytes_view datagram) {
        require(is_sealed(datagram) && datagram.size() <= max_data, "a datagram has a kind and a longest length");
        handshakes_ += datagram[0] == 0x81 ? 1 : 0;
        const auto from = &by == &car1_ ? at_car1 : at_car2;
        ++answers_;
        if (history_.size() < 256) {
            history_.push_back({from, {datagram.begin(), datagram.end()}});
        }
        if (!lost_ && (to == at_car1 || to == at_car2)) {
            under_way_.push_back({from, to, {datagram.begin(), datagram.end()}});
        }
    }
    void deliver(const node& to, std::string_view line) {
        if (&to == &car1_) {
            const auto found = sealed_.find(line);
            require(found != sealed_.end(), "a line that is opened was sealed, and counts once", line);
            sealed_.erase(found);
        }
    }

  private:
    struct sent {
        datagram_path from;
        bytes content;
    };
    struct on_its_way {
        datagram_path from;
        datagram_path to;
        bytes content;
    };

    static datagram_path path(std::uint32_t which) {
        return which % 4 == 0 ? at_car2 : datagram_path::v4(0x0a000002 + which % 2, static_cast<std::uint16_t>(which));
    }
    static std::uint32_t number(std::string_view argument) {
        std::uint32_t value = 0;
        for (const auto byte : bytes_of(argument.substr(0, 3))) {
            value = value << 8U | byte;
        }
        return value;
    }
    [[nodiscard]] datagram_source peer() const { return {.path = at_car2, .member = car2_->number()}; }
    [[nodiscard]] bool is_known(bytes_view datagram) const {
        return std::ranges::any_of(history_, [&](const auto& s) { return std::ranges::equal(s.content, datagram); });
    }

    void talk(node& by, const datagram_source& to, std::string_view line) {
        if (by.sessions.send(to, line, now_)) {
            require(line.size() <= max_line, "a line has a longest length");
            if (&by != &car1_ && !line.empty()) {
                sealed_.emplace(line);
            }
        }
    }
    void begin(node& by, const datagram_source& with) {
        if (handshakes_ < most_handshakes) {
            by.sessions.contact(with, now_);
        }
    }
    void check(std::uint32_t seconds) {
        if (handshakes_ < most_handshakes) {
            car1_.sessions.check_peer(peer(), now_ - std::chrono::seconds{seconds}, now_);
        }
    }
    void start_car2(std::string_view argument) {
        under_way_.clear();
        const auto counter = argument.size() > 6 ? ~std::uint64_t{0} - number(argument.substr(3)) : number(argument);
        if (processes_.size() < 8) {
            processes_.push_back(std::make_unique<node>(*this, 2, 1000 + processes_.size(), number(argument), counter));
            car2_ = processes_.back().get();
            for (std::size_t i = 1; i <= roster_; ++i) {
                static_cast<void>(car2_->known.offer(rosters()[i]->line()));
            }
        }
    }

    void seal(std::string_view line) {
        const auto datagram = car2_->group.seal(line);
        require(datagram.empty() || datagram.size() == line.size() + 48, "a datagram of the group has its length");
        if (!datagram.empty()) {
            const bytes kept{datagram.begin(), datagram.end()};
            if (history_.size() < 256) {
                history_.push_back({at_car2, kept});
            }
            arrive_in_group(at_car2, kept);
        }
    }
    void arrive(const datagram_path& from, bytes_view datagram) {
        const bool known = is_known(datagram);
        const auto before = answers_;
        car1_.sessions.receive(from, datagram, now_);
        require(known || answers_ == before, "nothing is answered that no member has sealed");
    }
    void arrive_in_group(const datagram_path& from, bytes_view datagram) {
        const bool known = is_known(datagram);
        const auto result = car1_.receiver.open(from, datagram, now_);
        require(known || result.what == group_receiver::verdict::dropped, "no forged datagram is opened");
        if (result.what == group_receiver::verdict::opened &&
            car1_.receiver.accept(result.accepted_by, group_receiver::ordered_by::counter)) {
            const auto nonce = std::pair{result.accepted_by.salt, result.accepted_by.counter};
            require(accepted_.insert(nonce).second, "a counter is accepted once");
        }
        if (result.contact && handshakes_ < most_handshakes) {
            car1_.sessions.contact(*result.contact, now_);
        }
    }
    void repeat(std::uint32_t which, std::string_view argument) {
        if (history_.empty()) {
            return;
        }
        auto [from, content] = history_[which % history_.size()];
        if (argument.size() >= 4) {
            const auto place = number(argument.substr(1)) >> 8U;
            content[place % content.size()] ^= static_cast<std::uint8_t>(argument[3]);
        }
        if (content[0] == 0x84) {
            arrive_in_group(from, content);
        } else {
            arrive(from, content);
        }
    }
    void next_roster() {
        if (roster_ + 1 < rosters().size()) {
            ++roster_;
            under_way_.clear();
            static_cast<void>(car1_.known.offer(rosters()[roster_]->line()));
            static_cast<void>(car2_->known.offer(rosters()[roster_]->line()));
        }
    }

    void pass(std::uint32_t milliseconds) {
        const auto end = now_ + std::chrono::milliseconds{milliseconds};
        for (;;) {
            settle();
            auto next = end + std::chrono::milliseconds{1};
            for (const auto* const each : {&car1_, car2_}) {
                next = std::min(next, each->sessions.next_deadline().value_or(next));
            }
            if (next > end) {
                break;
            }
            now_ = std::max(now_, next);
            car1_.sessions.on_time(now_);
            car2_->sessions.on_time(now_);
        }
        now_ = end;
    }
    void settle() {
        for (int turns = 0; !under_way_.empty() && turns < 200; ++turns) {
            const auto one = std::move(under_way_.front());
            under_way_.pop_front();
            (one.to == at_car1 ? &car1_ : car2_)->sessions.receive(one.from, one.content, now_);
        }
        require(under_way_.empty(), "two nodes come to rest");
    }

    time_point now_{std::chrono::hours{1}};
    std::multiset<std::string, std::less<>> sealed_; // lines of car2 for car1
    std::set<std::pair<group_salt, std::uint64_t>> accepted_;
    std::vector<sent> history_;
    std::deque<on_its_way> under_way_;
    std::size_t handshakes_ = 0;
    std::size_t answers_ = 0;
    std::size_t roster_ = 0;
    bool lost_ = false;
    node car1_{*this, 1, 1, 0x11111111, 0};
    std::vector<std::unique_ptr<node>> processes_; // of car2
    node* car2_ = nullptr;
};

void node::send(const datagram_path& to, bytes_view datagram) { net_.carry(*this, to, datagram); }

void node::established(const datagram_source& with, const node_statement& stated, bool) {
    receiver.learn(with.member, stated);
}

void node::opened(const datagram_source&, std::uint32_t, std::string_view line) { net_.deliver(*this, line); }

} // namespace

void run(std::string_view input) {
    network net;
    for (std::size_t steps = 0; input.size() >= 3 && steps < most_steps; ++steps) {
        const auto head = bytes_of(input.substr(0, 3));
        const auto length = std::min<std::size_t>(std::size_t{head[1]} << 8U | head[2], input.size() - 3);
        net.step(head[0], input.substr(3, length));
        input.remove_prefix(3 + length);
    }
    net.end();
}

} // namespace cles::fuzz
