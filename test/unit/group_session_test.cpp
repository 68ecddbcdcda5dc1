// SPDX-License-Identifier: BSL-1.0
#include "core/group_session.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace {

using cles::core::group_source;

constexpr group_source self{.address = 0x7f000001, .port = 4000};
constexpr group_source other{.address = 0x7f000001, .port = 4001};

class recording_presence final : public cles::core::group_presence {
  public:
    void on_solicitation(bool by_name, cles::time_point) override {
        told.emplace_back(by_name ? "solicited by name" : "solicited");
    }
    void on_announcement(const group_source& from, const cles::protocol::request_line& update,
                         cles::time_point) override {
        told.push_back(std::to_string(from.port) + " " + std::string{update.noun.target} + " " +
                       std::to_string(*update.seq) + " " + std::string{update.body});
    }
    std::vector<std::string> told;
};

struct fixture {
    fixture() { session.attend(&presence); }
    void hear(std::string_view datagram, const group_source& from = other) {
        session.on_datagram(from, datagram, node.clock.now());
    }
    /// Whether it was dropped.
    bool drops(std::string_view datagram) {
        const auto before = node.counts().group_dropped;
        hear(datagram);
        return node.counts().group_dropped != before;
    }

    cles::test::test_node node;
    recording_presence presence;
    cles::core::group_session session{*node.host, self};
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(group_session, fixture)

BOOST_AUTO_TEST_CASE(a_source_is_written_as_an_address) {
    BOOST_TEST(host_text(group_source{.address = 0xC0000207, .port = 1}) == "192.0.2.7");
    BOOST_TEST(self.is_loopback());
    BOOST_TEST(!group_source{.address = 0xC0000207}.is_loopback());
}

BOOST_AUTO_TEST_CASE(an_announcement_is_handed_on) {
    hear(R"(UPDATE car2:cles seq=3 epoch=5f3a09c1 {"node":"car2"})"
         "\n");
    BOOST_REQUIRE(presence.told.size() == 1U);
    BOOST_TEST(presence.told[0] == R"(4001 car2 3 {"node":"car2"})");
    BOOST_TEST(node.counts().group_received == 1U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(a_solicitation_is_handed_on) {
    hear("BIND all:cles");
    BOOST_REQUIRE(presence.told.size() == 1U);
    BOOST_TEST(presence.told[0] == "solicited");
}

BOOST_AUTO_TEST_CASE(one_by_name_is_for_the_node_of_that_name_alone) {
    hear("BIND " + node.host->name + ":cles");
    hear("BIND another:cles");
    BOOST_REQUIRE(presence.told.size() == 1U);
    BOOST_TEST(presence.told[0] == "solicited by name");
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(what_the_node_itself_has_sent_is_left_alone) {
    hear("BIND all:cles", self);
    hear("nonsense", self);
    BOOST_TEST(presence.told.empty());
    BOOST_TEST(node.counts().group_received == 0U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

const std::vector<std::string> unwanted{
    "",
    "\n",
    "nonsense",
    "PULL self:cles",
    "PULL all:cles",
    "PUSH car1:speed {}",
    "DELEGATE all:plan {}",
    "PUSH self:cles/cancel/1",
    "UPDATE car1:localization {}",
    "UPDATE all:localization seq=1 epoch=5f3a09c1 {}",
    "UPDATE self:localization seq=1 epoch=5f3a09c1 {}",
    "UPDATE car2:localization seq=1 {}",
    "BIND self:localization",
    "BIND any:localization",
    "BIND all:cles/peers",
    "BIND car1:cles/peers",
    "BIND all:localization\nBIND all:speed",
    "BIND all:cles\n\n",
    "BIND all:cles {}",
    "BIND all:cles lease=x",
    "UPDATE car2:cles/x seq=1 epoch=5f3a09c1 {}",
    "UPDATE car2:cles seq=1 epoch=5f3a09c1 {\"node\":}",
    "UPDATE car2:cles seq=1 epoch=5f3a09c1",
    "{}",
    "id=1 {}",
};

BOOST_DATA_TEST_CASE(all_that_is_neither_BIND_of_a_name_nor_an_update_is_dropped, unwanted, datagram) {
    BOOST_TEST(drops(datagram));
    BOOST_TEST(presence.told.empty());
}

BOOST_AUTO_TEST_CASE(a_datagram_over_1200_bytes_is_dropped) {
    const std::string head = "UPDATE car2:cles seq=1 epoch=5f3a09c1 {\"x\":\"";
    const auto of = [&](std::size_t size) { return head + std::string(size - head.size() - 2, 'x') + "\"}"; };
    BOOST_TEST(drops(of(1201)));
    BOOST_TEST(!drops(of(1200)));
}

BOOST_AUTO_TEST_SUITE_END()
