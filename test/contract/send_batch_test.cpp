// SPDX-License-Identifier: BSL-1.0
// Each line becomes one datagram, even if several are sent by one system call. Over loopback.
#include "transport/datagram_io.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>

namespace send_batch {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

struct fixture {
    fixture() {
        from.connect(to.local_endpoint());
        from.non_blocking(true);
        to.set_option(asio::socket_base::receive_buffer_size{1 << 20});
    }
    /// The number of calls.
    int send_all(cles::transport::send_batch& burst, const std::vector<std::string>& lines) {
        std::string text;
        for (const auto& line : lines) {
            text += line;
        }
        int calls = 0;
        cles::core::datagrams_done done;
        for (std::string_view rest = text; !rest.empty(); ++calls) {
            const auto sent = burst.send(rest);
            BOOST_REQUIRE(sent.bytes > 0U);
            done.count += sent.count;
            rest.remove_prefix(sent.bytes);
        }
        BOOST_TEST(done.count == lines.size());
        return calls;
    }
    int send_all(const std::vector<std::string>& lines) {
        cles::transport::send_batch burst{from};
        return send_all(burst, lines);
    }
    /// The number of datagrams that arrived, and their contents.
    std::vector<std::string> come() {
        std::vector<std::string> texts;
        for (bool more = true; more;) {
            more = batch.fetch(to);
            ++fetches;
            while (!batch.empty()) {
                const auto one = batch.take();
                BOOST_TEST((one.from == from.local_endpoint()));
                texts.emplace_back(one.text);
            }
        }
        return texts;
    }

    asio::io_context io;
    udp::socket from{io, {asio::ip::address_v4::loopback(), 0}};
    udp::socket to{io, {asio::ip::address_v4::loopback(), 0}};
    cles::transport::receive_batch batch;
    int fetches = 0;
};

std::vector<std::string> lines_of(std::size_t count, std::size_t length) {
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < count; ++i) {
        lines.push_back(std::to_string(i) + ' ');
        lines.back().resize(length - 1, 'x');
        lines.back() += '\n';
    }
    return lines;
}

} // namespace
} // namespace send_batch

BOOST_FIXTURE_TEST_SUITE(send_batch, fixture)

BOOST_DATA_TEST_CASE(each_line_is_a_datagram_of_its_own, boost::unit_test::data::make({false, true}), together) {
    if (together) { // receives as another socket of this library does; otherwise as any program does
        cles::transport::receive_batch::prepare(to);
    }
    int taken_so = 0;
    socklen_t size = sizeof taken_so;
    const bool can = ::getsockopt(to.native_handle(), SOL_UDP, UDP_GRO, &taken_so, &size) == 0; // since Linux 5.0
    BOOST_TEST(taken_so == (can && together ? 1 : 0));
    auto lines = lines_of(100, 80);                  // more than the system accepts as one
    for (const auto length : {70, 90, 90, 90, 80}) { // shorter, longer, equal, shorter again
        lines.push_back(lines_of(1, static_cast<std::size_t>(length)).front());
    }
    for (const auto& line : lines_of(70, 1200)) { // more bytes than one datagram may have
        lines.push_back(line);
    }
    lines.emplace_back("\n");
    lines.emplace_back("x\n");
    const auto calls = send_all(lines);
    BOOST_TEST(come() == lines, boost::test_tools::per_element());
    if (can) {
        BOOST_TEST(calls == 1);
        const auto each_alone = static_cast<int>(lines.size() / cles::transport::receive_batch::most) + 1;
        BOOST_TEST((together ? fetches < 4 : fetches == each_alone));
    }
}

BOOST_AUTO_TEST_CASE(where_the_system_does_not_split_them_each_is_sent_alone) {
    const int off = 1; // without checksums it is not possible
    BOOST_REQUIRE(::setsockopt(from.native_handle(), SOL_SOCKET, SO_NO_CHECK, &off, sizeof off) == 0);
    cles::transport::receive_batch::prepare(to);
    cles::transport::send_batch burst{from};
    const auto lines = lines_of(40, 80);
    for (int i = 0; i < 2; ++i) {
        BOOST_TEST(send_all(burst, lines) == 2); // the eight that remain after one call
        BOOST_TEST(come() == lines, boost::test_tools::per_element());
    }
}

BOOST_AUTO_TEST_CASE(one_that_cannot_be_sent_is_lost_alone) {
    auto lines = lines_of(3, 80);
    const auto sent = lines;
    lines.insert(lines.begin() + 1, lines_of(1, 70'000).front()); // exceeds the maximum of UDP
    send_all(lines);
    BOOST_TEST(come() == sent, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
