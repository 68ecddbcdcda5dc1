// SPDX-License-Identifier: BSL-1.0
// A service that binds nouns of another pool, through a NATS server and bridges of which the test plays the part.

#include <cles/convert.hpp>
#include <cles/federation.hpp>
#include <cles/service.hpp>

#include "support/feed_log.hpp"
#include "support/metric.hpp"
#include "support/run_until.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace federated_feeds {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using cles::feed_event;
using cles::test::feed_log;
using cles::test::metric;
using cles::test::run_until;

/// A NATS server with one client.
class played_nats {
  public:
    struct message {
        std::string subject;
        std::string reply;
        std::string text;
    };

    [[nodiscard]] std::string url() const {
        return "nats://127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port());
    }
    /// The client connects on a thread of its own.
    void accept() {
        socket_ = acceptor_.accept();
        write("INFO {\"server_id\":\"a\",\"version\":\"2.9.0\",\"max_payload\":1048576}\r\n");
        while (!is_connected_) {
            read();
        }
    }
    /// Reads what has arrived.
    void poll() {
        while (socket_.available() != 0) {
            read();
        }
    }
    void send(std::string_view filter, const std::string& subject, std::string_view text,
              const std::string& reply = {}) {
        write("MSG " + subject + " " + subscriptions_.at(std::string{filter}) + " " +
              (reply.empty() ? "" : reply + " ") + std::to_string(text.size()) + "\r\n" + std::string{text} + "\r\n");
    }
    /// The filter of the bridge to which this subject belongs.
    [[nodiscard]] static std::string inbox_of(const std::string& subject) {
        return subject.substr(0, subject.rfind('.')) + ".*";
    }
    [[nodiscard]] bool subscribes(const std::string& filter) const { return subscriptions_.contains(filter); }
    /// Called when the client ends the subscription to that filter, before it gets the reply to a further PING.
    std::function<void(const std::string& filter)> on_end;
    /// How many messages the client has got that it had sent to its own inbox.
    [[nodiscard]] std::size_t returned() const noexcept { return returned_; }
    /// What the client has published on that subject.
    [[nodiscard]] std::vector<message> published(std::string_view subject) const {
        std::vector<message> found;
        std::ranges::copy_if(published_, std::back_inserter(found),
                             [subject](const message& each) { return each.subject == subject; });
        return found;
    }

  private:
    void write(const std::string& text) { asio::write(socket_, asio::buffer(text)); }
    // What the client sends to its own inbox.
    void deliver(const message& sent) {
        if (const auto inbox = inbox_of(sent.subject); subscribes(inbox)) {
            send(inbox, sent.subject, sent.text, sent.reply);
            ++returned_;
        }
    }
    void read() {
        std::array<char, 65536> some{};
        input_.append(some.data(), socket_.read_some(asio::buffer(some)));
        while (take_one()) {
        }
    }
    bool take_one() {
        const auto end = input_.find("\r\n");
        if (end == std::string::npos) {
            return false;
        }
        std::vector<std::string> words;
        for (std::size_t at = 0; at < end;) {
            const auto space = std::min(input_.find(' ', at), end);
            words.push_back(input_.substr(at, space - at));
            at = space + 1;
        }
        auto size = end + 2;
        if (words.at(0) == "PUB") {
            const auto length = std::stoul(words.back());
            if (input_.size() < size + length + 2) {
                return false;
            }
            published_.push_back({words.at(1), words.size() == 4 ? words.at(2) : "", input_.substr(size, length)});
            size += length + 2;
            deliver(published_.back());
        } else if (words[0] == "SUB") {
            subscriptions_[words.at(1)] = words.back();
        } else if (words[0] == "UNSUB") {
            for (const auto& [filter, id] : subscriptions_) {
                if (id == words.at(1) && on_end) {
                    on_end(filter);
                }
            }
        } else if (words[0] == "PING") {
            is_connected_ = true;
            write("PONG\r\n");
        }
        input_.erase(0, size);
        return true;
    }

    asio::io_context io_{1};
    tcp::acceptor acceptor_{io_, tcp::endpoint{asio::ip::address_v4::loopback(), 0}};
    tcp::socket socket_{io_};
    std::string input_;
    std::size_t returned_ = 0;
    std::map<std::string, std::string> subscriptions_; // the last id of each filter
    std::vector<message> published_;
    bool is_connected_ = false;
};

constexpr std::string_view one = "000000000000000a";
constexpr std::string_view other = "000000000000000b";

/// A service of the pool south, which knows two bridges of north.
struct fixture {
    fixture() {
        cles::service_options options{.name = "hub"};
        options.insecure = true;
        options.federation = cles::federation({.servers = {nats.url()}, .pool = "south"});
        hub.emplace(io, options);
        nats.accept();
        until([&] { return nats.subscribes(beats); });
        for (const auto by : {one, other}) {
            beat(by, {});
        }
        until([&] { return metric(*hub, "bridges", "federation") == 2U; }); // of north
    }
    template <class Condition>
    void until(Condition holds) {
        run_until(io, [&] {
            nats.poll();
            return holds();
        });
    }
    void beat(std::string_view by, const std::string& more) {
        nats.send(beats, "cles.north.beat." + std::string{by},
                  R"({"node":"gate","interval_ms":60000,"names":"85944171f73967e8")" + more + "}");
    }
    /// Binds, or waits until it is bound again, as the number of BINDs says: that bridge answers.
    void bind(feed_log& feed, const std::string& task, std::size_t times, std::string_view by) {
        if (times == 1) {
            feed.bind(*hub, "north.car1:" + task);
        }
        const auto subject = "cles.north.bind.car1." + task;
        until([&] { return nats.published(subject).size() == times; });
        const auto reply = nats.published(subject).back().reply;
        nats.send(played_nats::inbox_of(reply), reply, "taken=" + std::string{by} + " {}");
        until([&] { return times == 1 ? feed.bound : feed.count(feed_event::rebound) == times - 1; });
    }
    void update(const std::string& task, int seq, const std::string& body) {
        const auto subject = "cles.north.feed.car1." + task;
        nats.send(subject, subject, " seq=" + std::to_string(seq) + " epoch=5f3a09c1 " + body);
    }

    const std::string beats = "cles.*.beat.*";
    asio::io_context io{1};
    played_nats nats;
    std::optional<cles::service> hub;
    feed_log pose;
    feed_log speed;
};

} // namespace
} // namespace federated_feeds

BOOST_FIXTURE_TEST_SUITE(federated_feeds, fixture)

BOOST_AUTO_TEST_CASE(a_lost_bridge_takes_only_its_own_bindings_with_it) {
    bind(pose, "pose", 1, one);
    bind(speed, "speed", 1, other);
    beat(one, R"(,"leaving":true)");
    bind(pose, "pose", 2, other);
    BOOST_TEST(pose.count(feed_event::lost) == 1U);
    update("pose", 7, "[7]");
    update("speed", 1, "[1]");
    until([&] { return pose.bodies().size() == 1 && speed.bodies().size() == 1; });
    BOOST_TEST(speed.count(feed_event::lost) == 0U);
    BOOST_TEST(nats.published("cles.north.bind.car1.speed").size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_a_full_link_does_not_take_is_counted) {
    bind(pose, "pose", 1, one);
    // The server reads nothing. So the link counts as slow, and the service takes nothing from it until it has sent.
    int sent = 0;
    run_until(io, [&] {
        io.poll();
        if (metric(*hub, "unsent", "federation") < 2'000'000) {
            hub->async_push("north.car1:log", cles::json_text{"[\"" + std::string(500'000, 'x') + "\"]"},
                            [](boost::system::error_code, const cles::json_text&) {});
        }
        update("pose", ++sent, "[\"" + std::string(8'000, 'x') + "\"]");
        return metric(*hub, "updates_dropped_to_node", "federation") != 0;
    });
    until([&] { return metric(*hub, "updates_received", "federation") == static_cast<std::uint64_t>(sent); });
    const auto dropped = metric(*hub, "updates_dropped_to_node", "federation");
    until([&] { // the server reads again
        update("pose", ++sent, "[1]");
        return !pose.items.empty() && pose.items.back().value.text == "[1]";
    });
    BOOST_TEST(pose.missed() >= dropped);
    BOOST_TEST(metric(*hub, "updates_dropped_to_nats", "federation") == 0U);
}

// The server had sent it before it knew that the bridge takes no more.
BOOST_AUTO_TEST_CASE(a_request_to_a_bridge_that_leaves_is_answered) {
    nats.on_end = [this](const std::string& filter) {
        if (filter == "cles.south.pull.*.*") {
            nats.send(filter, "cles.south.pull.hub.speed", "", "_INBOX.1");
        }
    };
    bool is_closed = false;
    const auto begun = std::chrono::steady_clock::now();
    hub->async_close(std::chrono::seconds{10}, [&](boost::system::error_code) { is_closed = true; });
    until([&] { return nats.published("_INBOX.1").size() == 1U; });
    const auto reply = nats.published("_INBOX.1")[0].text;
    BOOST_TEST(reply.starts_with(R"({"error":"busy")"), reply);
    until([&] { return is_closed; });
    // Its own line came back, behind the request: without it, a bridge waits for half a second.
    BOOST_TEST(nats.returned() != 0U);
    BOOST_WARN((std::chrono::steady_clock::now() - begun < std::chrono::milliseconds{450}));
}

BOOST_AUTO_TEST_CASE(a_request_to_a_pool_that_has_left_fails_at_once) {
    for (const auto by : {one, other}) {
        beat(by, R"(,"leaving":true)");
    }
    until([&] { return metric(*hub, "bridges_lost", "federation") == 2U; });
    boost::system::error_code why;
    const auto begun = std::chrono::steady_clock::now();
    hub->async_pull("north.car1:speed", [&](boost::system::error_code code, const cles::json_text&) { why = code; });
    until([&] { return why.failed(); });
    BOOST_TEST(why.message() == "none of its bridges is connected to NATS");
    BOOST_TEST((std::chrono::steady_clock::now() - begun < std::chrono::seconds{2})); // for which others wait
}

BOOST_AUTO_TEST_SUITE_END()
