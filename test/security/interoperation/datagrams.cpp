// SPDX-License-Identifier: BSL-1.0
// A node that seals and opens datagrams and messages, driven by datagram_interoperation_test.py: commands by standard
// input, one a line; what the node does by standard output, and a line with a point after each command.
//
//   node NAME SEED FLEET EPOCH ROSTER   comes first: the name, keys and epoch in hexadecimal digits, the roster line
//   send MEMBER LINE                    to the only address that there is
//   contact MEMBER
//   receive DATAGRAM                    in hexadecimal digits
//   wait MILLISECONDS
//   seal LINE                           for the group
//   open DATAGRAM                       from the group
//
// Of messages through NATS, the subject for replies may be '-', and the member's subject for questions is `questions`:
//
//   instance
//   seal_message SUBJECT REPLY TEXT
//   open_message SUBJECT REPLY INSTANCE QUESTIONS MESSAGE
//   able INSTANCE QUESTIONS                                 that bridge has sessions
//   seal_for INSTANCE SUBJECT REPLY TEXT                    a message for that bridge
//   open_for SUBJECT REPLY INSTANCE QUESTIONS MESSAGE       one for this bridge
//   question SUBJECT INSTANCE QUESTIONS MESSAGE
//   stated INSTANCE QUESTIONS VERSION
#include "protocol/request_line.hpp"
#include "security/datagrams/datagram_sessions.hpp"
#include "security/datagrams/group_receiver.hpp"
#include "security/datagrams/group_sender.hpp"
#include "security/hex.hpp"
#include "security/keys/bytes.hpp"
#include "security/messages/sealed_messages.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::security;
using cles::security::test::from_hex;
using cles::security::test::to_hex;

constexpr auto peer_at = datagram_path::v4(0x7f000001, 25370);

std::shared_ptr<const roster> read_roster(const std::string& line, bytes_view fleet_key) {
    public_key key{};
    std::ranges::copy(fleet_key, key.begin());
    return roster::read(line, key);
}

class node final : public datagram_sink {
  public:
    node(std::string name, std::string_view seed, std::string_view fleet_key, std::uint32_t epoch,
         const std::string& roster_line)
        : epoch_(epoch), fleet_(std::move(name), signing_key{secret_bytes{from_hex(seed)}},
                                read_roster(roster_line, from_hex(fleet_key))),
          sender_(fleet_, system_entropy()), receiver_(fleet_, sender_, system_entropy()),
          sessions_(fleet_, *this, system_entropy()),
          messages_(fleet_, system_entropy(), [this](std::string_view line) {
              std::cout << "roster " << line << "\n";
              static_cast<void>(fleet_.offer(line));
          }) {}

    void run(const std::string& command, const std::string& rest) {
        if (command == "send") {
            const auto space = rest.find(' ');
            sessions_.send(to(rest), rest.substr(space + 1), now_);
        } else if (command == "contact") {
            sessions_.contact(to(rest), now_);
        } else if (command == "receive") {
            sessions_.receive(peer_at, from_hex(rest), now_);
        } else if (command == "wait") {
            now_ += std::chrono::milliseconds{std::stoi(rest)};
            sessions_.on_time(now_);
        } else if (command == "seal") {
            std::cout << "sealed " << to_hex(sender_.seal(rest)) << "\n";
        } else if (command == "open") {
            open(from_hex(rest));
        } else {
            run_message(command, rest);
        }
    }

  private:
    static datagram_source to(const std::string& text) {
        return {.path = peer_at, .member = static_cast<std::uint32_t>(std::stoul(text))};
    }
    void open(bytes_view datagram) {
        const auto result = receiver_.open(peer_at, datagram, now_);
        if (result.what == group_receiver::verdict::opened) {
            const bool accepted = receiver_.accept(result.accepted_by, group_receiver::ordered_by::counter);
            std::cout << (accepted ? "accepted " : "refused ") << result.accepted_by.member << " "
                      << cles::protocol::epoch_text(result.epoch) << " " << result.line << "\n";
        }
        if (result.contact) {
            std::cout << "unknown " << result.contact->member << "\n";
        }
    }

    void run_message(const std::string& command, const std::string& rest) {
        std::istringstream words{rest};
        const auto next = [&words] {
            std::string word;
            words >> word;
            return word == "-" ? std::string{} : word;
        };
        if (command == "instance") {
            std::cout << "instance " << messages_.instance() << "\n";
        } else if (command == "seal_message") {
            const auto subject = next();
            const auto reply = next();
            words >> std::ws;
            std::string text;
            std::getline(words, text);
            std::cout << "sealed " << to_hex(as_bytes(messages_.seal(subject, reply, text))) << "\n";
        } else if (command == "seal_for") {
            const auto addressee = std::stoull(next());
            const auto subject = next();
            const auto reply = next();
            words >> std::ws;
            std::string text;
            std::getline(words, text);
            const auto sealed = messages_.seal_for(addressee, subject, reply, text, now_);
            std::cout << (sealed.waits ? "waits" : "sealed " + to_hex(as_bytes(sealed.bytes))) << "\n";
        } else if (command == "open_message" || command == "open_for") {
            const auto subject = next();
            const auto reply = next();
            const auto instance = std::stoull(next());
            const auto questions = next();
            const auto result = messages_.open(
                subject, reply, {.instance = instance, .questions = questions, .is_for_one = command == "open_for"},
                as_text(from_hex(next())), now_);
            constexpr std::array names{"refused", "unproven", "opened"};
            std::cout << names.at(static_cast<std::size_t>(result.what)) << " " << result.sender << " "
                      << result.message << "\n";
        } else if (command == "question") {
            const auto subject = next();
            const auto instance = std::stoull(next());
            const auto questions = next();
            if (messages_.on_question(subject, {.instance = instance, .questions = questions},
                                      as_text(from_hex(next())), now_)) {
                std::cout << "heartbeat\n";
            }
        } else if (command == "able") {
            const auto instance = std::stoull(next());
            const auto questions = next();
            messages_.on_stated_sessions({.instance = instance, .questions = questions}, now_);
        } else if (command == "stated") {
            const auto instance = std::stoull(next());
            const auto questions = next();
            messages_.on_stated_roster({.instance = instance, .questions = questions},
                                       static_cast<std::uint32_t>(std::stoul(next())), now_);
        } else {
            throw std::runtime_error{"unknown command " + command};
        }
        for (const auto& each : messages_.take_questions("questions")) {
            std::cout << "question " << each.subject << " " << to_hex(as_bytes(each.message)) << "\n";
        }
    }

    void send(const datagram_path&, bytes_view datagram) override {
        std::cout << "datagram " << to_hex(datagram) << "\n";
    }
    node_statement statement() override {
        return {.roster = fleet_.in_force().version(),
                .epoch = epoch_,
                .salt = sender_.salt(),
                .counter = sender_.next_counter()};
    }
    void established(const datagram_source& with, const node_statement& stated, bool restarted) override {
        receiver_.learn(with.member, stated);
        std::cout << "established " << with.member << " " << stated.roster << " "
                  << cles::protocol::epoch_text(stated.epoch) << " " << to_hex(stated.salt) << " " << stated.counter
                  << " " << (restarted ? "restarted" : "-") << "\n";
    }
    void opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) override {
        std::cout << "opened " << from.member << " " << cles::protocol::epoch_text(epoch) << " " << line << "\n";
    }
    void gave_up(const datagram_source& with, bool) override { std::cout << "gave_up " << with.member << "\n"; }

    std::uint32_t epoch_;
    cles::time_point now_{std::chrono::hours{1}};
    fleet fleet_;
    group_sender sender_;
    group_receiver receiver_;
    datagram_sessions sessions_;
    sealed_messages messages_;
};

} // namespace

int main() {
    try {
        std::unique_ptr<node> made;
        for (std::string line; std::getline(std::cin, line);) {
            std::istringstream words{line};
            std::string command;
            words >> command;
            if (command == "node") {
                std::string name;
                std::string seed;
                std::string fleet_key;
                std::string epoch;
                words >> name >> seed >> fleet_key >> epoch >> std::ws;
                std::string roster_line;
                std::getline(words, roster_line);
                made = std::make_unique<node>(name, seed, fleet_key,
                                              static_cast<std::uint32_t>(std::stoul(epoch, nullptr, 16)), roster_line);
            } else if (made) {
                made->run(command, line.substr(std::min(line.size(), command.size() + 1)));
            }
            std::cout << "." << std::endl;
        }
    } catch (const std::exception& e) {
        std::cerr << e.what() << "\n";
        return 1;
    }
}
