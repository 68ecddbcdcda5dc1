// SPDX-License-Identifier: BSL-1.0
// Messages through NATS, arbitrary ones and those of a second bridge. car1 is the node under test; car2 is a bridge
// that the fuzzer controls in everything but its key and its salts. The input is a series of steps: an operation (1
// byte), the length of its argument (2 bytes, big-endian), and the argument:
//
//     0  a message arrives            1  a question arrives
//     2  car2 sends a message         3  car2 sends a question
//     4  car1 sends a message, which car2 opens
//     5  questions and answers arrive 6  they are lost
//     7  car2 connects anew           8  car1 connects anew
//     9  time passes (3 bytes: milliseconds)
//     a  what was sent before arrives (first byte: which), with a byte changed (2 bytes: where, and how)
//     b  the next roster comes into force at car2: rotated, without car3, with car3 as a new member
//     c  car2 states a version of its roster (1 byte)
//     d  both state that they have sessions
//     e  car2 sends a message for car1 alone, under a session if there is one
//
// For every input: car1 opens no message that car2 has not sealed for that subject, none twice, and none that is older
// than its question whether car2 is alive; no forged question counts; its roster never becomes an older one; after a
// silence and a new connection, nothing that was sent before counts.
#include "fuzz/fuzz.hpp"
#include "fuzz/seeded_keys.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/keys/bytes.hpp"
#include "security/messages/sealed_messages.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::fuzz {
namespace {

using namespace cles::security;
using verdict = core::message_seal::verdict;

constexpr std::size_t most_steps = 100;

// The rosters that come into force, made once.
const std::vector<std::shared_ptr<const roster>>& rosters() {
    static const auto made = [] {
        std::vector<std::shared_ptr<const roster>> all;
        auto authority = fleet_authority::found(key_from(200));
        const auto keep = [&] { all.push_back(authority.share()); };
        for (std::uint8_t car = 1; car <= 3; ++car) {
            authority.add({.name = "car" + std::to_string(car), .key = key_from(car).public_part()});
        }
        keep();
        authority.rotate();
        keep();
        authority.remove("car3");
        keep();
        authority.add({.name = "car3", .key = key_from(3).public_part()});
        keep();
        return all;
    }();
    return made;
}

std::uint32_t number(std::string_view argument) {
    std::uint32_t value = 0;
    for (const auto byte : as_bytes(argument.substr(0, 3))) {
        value = value << 8U | byte;
    }
    return value;
}

// As NATS carries it, with what its subjects state of the sender.
struct carried {
    std::string subject;
    std::string reply;
    std::uint64_t instance = 0;
    std::string bytes;
    std::size_t order = 0;   // of sealing
    bool is_for_one = false; // for car1 alone

    [[nodiscard]] core::message_seal::origin from() const {
        return {.instance = instance, .questions = reply, .is_for_one = is_for_one};
    }
    [[nodiscard]] bool is(const carried& other) const {
        return subject == other.subject && reply == other.reply && bytes == other.bytes;
    }
};

// One connection of a bridge.
class bridge {
  public:
    bridge(fleet& of, std::uint64_t seed, std::string name)
        : questions(std::move(name)), random_(seed),
          messages(of, random_, [&of](std::string_view line) { static_cast<void>(of.offer(line)); }) {}

    const std::string questions; // its subject

  private:
    seeded_entropy random_;

  public:
    sealed_messages messages;
};

class network {
  public:
    /// \param seed the fuzzer must not be able to learn challenges
    explicit network(std::uint64_t seed) : seed_(seed) {}

    void step(int operation, std::string_view argument) {
        const auto first = argument.empty() ? 0U : static_cast<std::uint8_t>(argument.front());
        const auto version = car1_fleet_.in_force().version();
        switch (operation) {
        case 0:
            receive({.subject = "x", .reply = car2_->questions, .instance = instance(first), .bytes = tail(argument)});
            break;
        case 1:
            ask({.subject = car1_->questions,
                 .reply = car2_->questions,
                 .instance = instance(first),
                 .bytes = tail(argument)});
            break;
        case 2: receive(seal("x", argument)); break;
        case 3: ask(seal(car1_->questions, argument)); break;
        case 4: send_to_car2(argument); break;
        case 5: settle(); break;
        case 6: lose(); break;
        case 7: car2_ = connect(car2_fleet_); break;
        case 8: connect_car1(); break;
        case 9: now_ += std::chrono::milliseconds{number(argument)}; break;
        case 10: repeat(first, argument); break;
        case 11: next_roster(); break;
        case 12:
            car1_->messages.on_stated_roster({.instance = instance(0), .questions = car2_->questions}, first, now_);
            break;
        case 13: state_sessions(); break;
        case 14: send_in_session(argument); break;
        default: break;
        }
        require(car1_fleet_.in_force().version() >= version, "a roster is never replaced by an older one");
    }

    /// Nothing that was sent before counts after a silence and new connections.
    void end() {
        lose();
        now_ += std::chrono::minutes{1};
        connect_car1();
        for (const auto& each : history_) {
            require(open(each) != verdict::opened, "no message that was sent before counts");
            require(!car1_->messages.on_question(car1_->questions, each.from(), each.bytes, now_),
                    "no question or answer that was sent before counts");
        }
    }

  private:
    std::unique_ptr<bridge> connect(fleet& of) {
        ++connections_;
        return std::make_unique<bridge>(of, seed_ + connections_, "questions" + std::to_string(connections_));
    }
    void connect_car1() {
        car1_ = connect(car1_fleet_);
        asked_.clear();
    }
    [[nodiscard]] std::uint64_t instance(std::uint32_t which) const {
        return which % 4 == 3 ? std::uint64_t{which} << 40U : which % 4 == 2 ? 0 : car2_->messages.instance();
    }
    static std::string tail(std::string_view argument) {
        return std::string{argument.substr(std::min<std::size_t>(argument.size(), 1))};
    }
    [[nodiscard]] bool is_known(const carried& message) const {
        return std::ranges::any_of(history_, [&](const carried& each) { return each.is(message); });
    }
    carried seal(const std::string& subject, std::string_view text) {
        carried made{.subject = subject, .reply = car2_->questions, .instance = car2_->messages.instance()};
        made.bytes = car2_->messages.seal(made.subject, made.reply, text);
        made.order = ++order_;
        require(made.bytes.size() == text.size() + core::message_seal::overhead, "a message has its length");
        history_.push_back(made);
        return made;
    }

    verdict open(const carried& message) {
        const auto result = car1_->messages.open(message.subject, message.reply, message.from(), message.bytes, now_);
        require(result.what == verdict::refused || is_known(message), "nothing forged is opened");
        require((result.what == verdict::refused) == !result.why.empty(), "a refusal says why");
        if (result.what == verdict::opened) {
            const auto asked = asked_.find(message.reply);
            require(asked != asked_.end() && message.order > asked->second, "its sender was alive when it was asked");
            require(opened_.insert(message.bytes).second, "a message counts once");
        }
        return result.what;
    }
    void receive(const carried& message) { static_cast<void>(open(message)); }
    void ask(const carried& message) {
        if (message.subject != car1_->questions) { // NATS delivers it to nobody
            return;
        }
        const bool known = is_known(message);
        const bool is_heard = car1_->messages.on_question(message.subject, message.from(), message.bytes, now_);
        require(known || !is_heard, "nothing forged is heard");
    }
    void send_to_car2(std::string_view text) {
        const auto bytes = car1_->messages.seal("y", "", text);
        const auto result = car2_->messages.open(
            "y", "", {.instance = car1_->messages.instance(), .questions = car1_->questions}, bytes, now_);
        require(result.what == verdict::refused || result.message == text, "a message is read as it was written");
        require(result.what != verdict::refused ||
                    car1_fleet_.in_force().generation() < car2_fleet_.in_force().oldest(),
                "an honest message is not refused", result.why);
    }
    void state_sessions() {
        car1_->messages.on_stated_sessions({.instance = car2_->messages.instance(), .questions = car2_->questions},
                                           now_);
        car2_->messages.on_stated_sessions({.instance = car1_->messages.instance(), .questions = car1_->questions},
                                           now_);
    }
    void send_in_session(std::string_view text) {
        carried made{.subject = "x", .reply = car2_->questions, .instance = car2_->messages.instance()};
        auto sealed = car2_->messages.seal_for(car1_->messages.instance(), made.subject, made.reply, text, now_);
        if (sealed.bytes.empty()) {
            require(sealed.waits, "a message is sealed, or waits");
            return;
        }
        made.bytes = std::move(sealed.bytes);
        made.order = ++order_;
        made.is_for_one = true;
        history_.push_back(made);
        receive(made);
    }
    std::vector<carried> take(bridge& by) {
        std::vector<carried> taken;
        for (auto& each : by.messages.take_questions(by.questions)) {
            carried made{.subject = std::move(each.subject), .reply = by.questions, .instance = by.messages.instance()};
            made.bytes = std::move(each.message);
            made.order = ++order_;
            taken.push_back(std::move(made));
        }
        require(taken.size() <= sealed_messages::max_questions, "what waits is limited");
        return taken;
    }
    std::vector<carried> take_of_car1() {
        constexpr std::size_t ask_bytes = core::message_seal::overhead + 26; // that of an answer is longer
        auto taken = take(*car1_);
        for (const auto& each : taken) {
            history_.push_back(each);
            if (each.bytes.size() == ask_bytes) {
                asked_.emplace(each.subject, each.order);
            }
        }
        return taken;
    }
    void settle() {
        for (int turns = 0;; ++turns) {
            require(turns < 8, "two bridges come to rest");
            const auto of_car1 = take_of_car1();
            const auto of_car2 = take(*car2_);
            if (of_car1.empty() && of_car2.empty()) {
                return;
            }
            for (const auto& each : of_car1) {
                if (each.subject == car2_->questions) {
                    static_cast<void>(car2_->messages.on_question(each.subject, each.from(), each.bytes, now_));
                }
            }
            for (const auto& each : of_car2) {
                history_.push_back(each);
                ask(each);
            }
        }
    }
    void lose() {
        static_cast<void>(take_of_car1());
        static_cast<void>(take(*car2_));
    }
    void repeat(std::uint32_t which, std::string_view argument) {
        if (history_.empty()) {
            return;
        }
        auto message = history_[which % history_.size()];
        if (argument.size() >= 4) {
            const auto place = number(argument.substr(1)) >> 8U;
            auto& byte = message.bytes[place % message.bytes.size()];
            byte = static_cast<char>(byte ^ argument[3]);
        }
        if (message.subject == "x") {
            receive(message);
        } else {
            ask(message);
        }
    }
    void next_roster() {
        if (roster_ + 1 < rosters().size()) {
            static_cast<void>(car2_fleet_.offer(rosters()[++roster_]->line()));
        }
    }

    std::uint64_t seed_;
    time_point now_{std::chrono::hours{1}};
    std::uint64_t connections_ = 0;
    std::size_t order_ = 0;
    std::size_t roster_ = 0;
    std::vector<carried> history_;
    std::set<std::string> opened_;
    std::map<std::string, std::size_t> asked_; // when car1 asked first, by the subject
    fleet car1_fleet_{"car1", key_from(1), rosters().front()};
    fleet car2_fleet_{"car2", key_from(2), rosters().front()};
    std::unique_ptr<bridge> car1_ = connect(car1_fleet_);
    std::unique_ptr<bridge> car2_ = connect(car2_fleet_);
};

} // namespace

void run(std::string_view input) {
    network net{std::hash<std::string_view>{}(input)};
    for (std::size_t steps = 0; input.size() >= 3 && steps < most_steps; ++steps) {
        const auto head = as_bytes(input.substr(0, 3));
        const auto length = std::min<std::size_t>(std::size_t{head[1]} << 8U | head[2], input.size() - 3);
        net.step(head[0], input.substr(3, length));
        input.remove_prefix(3 + length);
    }
    net.end();
}

} // namespace cles::fuzz
