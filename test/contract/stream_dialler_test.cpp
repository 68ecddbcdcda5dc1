// SPDX-License-Identifier: BSL-1.0
// A host with several addresses: they are tried one after another, and the first to answer wins.

#include "support/run_until.hpp"
#include "support/silent_listener.hpp"
#include "transport/stream_codec.hpp"
#include "transport/stream_endpoint.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stream_dialler {
namespace {

using boost::asio::ip::tcp;
using cles::test::run_until;
using dialler = cles::transport::stream_dialler;
using cles::transport::stream_socket;

const auto loopback = boost::asio::ip::address_v4::loopback();

/// Opens the link at once, or waits for the peer.
class codec final : public cles::transport::stream_codec {
  public:
    explicit codec(bool opens) : opens_(opens) {}

    std::span<char> prepare() override { return space_; }
    void commit(std::size_t) override {}
    status open(boost::system::error_code&) override { return opens_ ? status::done : status::need_input; }
    [[nodiscard]] std::chrono::milliseconds time_to_open() const override { return std::chrono::hours{1}; }
    void describe(cles::identity&) const override {}
    [[nodiscard]] std::string_view epoch() const noexcept override { return {}; }
    void watch(std::function<void(boost::system::error_code)>) override {}
    status decode(std::span<char>, std::size_t&, boost::system::error_code&) override { return status::need_input; }
    void encode(std::string_view, boost::system::error_code&) override {}
    void finish() override {}
    [[nodiscard]] std::string& encoded() noexcept override { return encoded_; }
    [[nodiscard]] std::size_t buffered() const noexcept override { return 0; }
    void shrink() override {}

  private:
    bool opens_;
    std::array<char, 16> space_{};
    std::string encoded_;
};

struct fixture {
    // Dials, and returns the result: "link to 4711", or the message of the failure.
    std::string dial(std::vector<tcp::endpoint> where, const cles::transport::codec_maker& make_codec = nullptr) {
        std::string ended;
        const auto identify = [](stream_socket& s) {
            const auto any = s.remote_endpoint();
            tcp::endpoint peer;
            std::memcpy(peer.data(), any.data(), any.size());
            return cles::identity{.transport = "tcp", .address = std::to_string(peer.port())};
        };
        const auto d = std::make_shared<dialler>(
            io.get_executor(), cles::limits{}, identify,
            [&](boost::system::error_code code, const cles::link_ptr& made) {
                ended = code ? code.message() : "link to " + made->peer().address;
                if (made) {
                    made->close();
                }
            },
            make_codec);
        d->start(std::vector<cles::transport::stream_address>(where.begin(), where.end()),
                 [&](std::size_t which) { answered = which; });
        run_until(io, [&] { return !ended.empty(); });
        return ended;
    }
    tcp::endpoint nobody() {
        tcp::acceptor gone{io, {loopback, 0}};
        return gone.local_endpoint();
    }

    boost::asio::io_context io;
    std::optional<std::size_t> answered;
    tcp::acceptor listener{io, {loopback, 0}};
    std::string success = "link to " + std::to_string(listener.local_endpoint().port());
};

} // namespace
} // namespace stream_dialler

BOOST_FIXTURE_TEST_SUITE(stream_dialler, fixture)

BOOST_AUTO_TEST_CASE(uses_the_first_that_accepts) {
    tcp::acceptor other{io, {loopback, 0}};
    BOOST_TEST(dial({listener.local_endpoint(), other.local_endpoint()}) == success);
}

BOOST_AUTO_TEST_CASE(tries_the_next_where_there_is_no_listener) {
    BOOST_TEST(dial({nobody(), nobody(), listener.local_endpoint()}) == success);
}

BOOST_AUTO_TEST_CASE(tries_the_next_while_one_is_silent) {
    const cles::test::silent_listener silent{io};
    BOOST_TEST(dial({silent.where(), listener.local_endpoint()}) == success);
    BOOST_TEST((answered == 1U));
}

BOOST_AUTO_TEST_CASE(with_a_codec_an_address_has_answered_when_the_link_is_open) {
    tcp::acceptor other{io, {loopback, 0}}; // accepts, and says nothing
    const auto port = std::to_string(other.local_endpoint().port());
    BOOST_TEST(dial({other.local_endpoint(), listener.local_endpoint()}, [&](const cles::identity& peer) {
                   return std::make_unique<codec>(peer.address != port);
               }) == success);
}

BOOST_AUTO_TEST_CASE(fails_with_the_last_failure_if_none_accepts) {
    BOOST_TEST(dial({nobody(), nobody()}) == "Connection refused");
}

BOOST_AUTO_TEST_CASE(no_event_follows_cancellation) {
    bool called = false;
    const auto d = std::make_shared<dialler>(
        io.get_executor(), cles::limits{}, [](stream_socket&) { return cles::identity{}; },
        [&](boost::system::error_code, const cles::link_ptr&) { called = true; });
    d->start({nobody(), listener.local_endpoint()});
    d->give_up();
    cles::test::run_ready(io);
    BOOST_TEST(!called);
}

BOOST_AUTO_TEST_SUITE_END()
