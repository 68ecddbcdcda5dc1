// SPDX-License-Identifier: BSL-1.0
#include "nats/nats_connection.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/test/unit_test.hpp>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace nats_reconnect {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using cles::nats::event;

/// The server's side of one connection at a time, in the protocol of NATS.
class one_server {
  public:
    [[nodiscard]] std::string url() const {
        return "nats://127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port());
    }
    void accept() {
        socket_ = acceptor_.accept();
        input_.clear();
        asio::write(socket_, asio::buffer(std::string_view{
                                 "INFO {\"server_id\":\"a\",\"version\":\"2.9.0\",\"max_payload\":1048576}\r\n"}));
        read_until("PING\r\n");
        asio::write(socket_, asio::buffer(std::string_view{"PONG\r\n"}));
    }
    void close() { socket_.close(); }
    /// All that has arrived up to this, included.
    std::string read_until(std::string_view end) {
        const auto size = asio::read_until(socket_, asio::dynamic_buffer(input_), end);
        auto text = input_.substr(0, size);
        input_.erase(0, size);
        return text;
    }

  private:
    asio::io_context io_{1};
    tcp::acceptor acceptor_{io_, tcp::endpoint{asio::ip::address_v4::loopback(), 0}};
    tcp::socket socket_{io_};
    std::string input_;
};

/// Waits for the thread.
class wakes {
  public:
    void wake() {
        const std::lock_guard lock{mutex_};
        woken_ = true;
        changed_.notify_one();
    }
    void wait() {
        std::unique_lock lock{mutex_};
        changed_.wait(lock, [this] { return woken_; });
        woken_ = false;
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool woken_ = false;
};

} // namespace
} // namespace nats_reconnect

BOOST_AUTO_TEST_SUITE(nats_reconnect)

BOOST_AUTO_TEST_CASE(what_is_published_before_a_new_connection_is_noticed_is_not_sent_on_it) {
    one_server server;
    wakes woken;
    const auto held =
        cles::nats::nats_connection::start({.servers = {server.url()}, .name = "test"}, [&woken] { woken.wake(); });
    auto& connection = *held;
    std::deque<event> taken;
    const auto next = [&] {
        while (taken.empty()) {
            woken.wait();
            for (auto& each : connection.take()) {
                taken.push_back(std::move(each));
            }
        }
        auto first = std::move(taken.front());
        taken.pop_front();
        return first;
    };
    server.accept();
    const auto first = next();
    BOOST_REQUIRE((first.what == event::kind::connected));
    connection.use(first.connection);
    BOOST_TEST(connection.publish("cles.a", {}, "first"));
    connection.flush();
    server.read_until("first\r\n");

    server.close();
    while (next().what != event::kind::disconnected) {
    }
    BOOST_REQUIRE(taken.empty());
    server.accept();
    woken.wait(); // the thread has connected, but nobody here has looked
    BOOST_TEST(connection.publish("cles.a", {}, "of_the_old_connection"));
    connection.flush();

    const auto noticed = connection.take();
    BOOST_REQUIRE(noticed.size() == 1U);
    const auto& second = noticed.front();
    BOOST_REQUIRE((second.what == event::kind::connected));
    BOOST_TEST(second.connection != first.connection);
    connection.use(second.connection);
    BOOST_TEST(connection.publish("cles.a", {}, "of_the_new_connection"));
    connection.flush();
    const auto sent = server.read_until("of_the_new_connection\r\n");
    BOOST_TEST(sent.find("of_the_old_connection") == std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()
