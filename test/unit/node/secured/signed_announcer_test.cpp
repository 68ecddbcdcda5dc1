// SPDX-License-Identifier: BSL-1.0
#include "node/secured/signed_announcer.hpp"
#include "protocol/request_line.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace signed_announcer {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::test::scripted_security;

struct fixture {
    static announcement content() {
        return {.node = "car1", .endpoints = {"tls://10.0.0.2:1"}, .load = {.workers = 4}, .roster = 7};
    }
    /// "signed SEQ" or "load SEQ {...}".
    std::string announce(announcement said = content(), bool in_group = true, bool by_gossip = false) {
        const auto line = announcer.announce(said, seq, in_group, by_gossip);
        if (by_gossip) {
            node.host->peers.announce_self(said, seq, node.host->time.now());
        }
        BOOST_TEST(line.ends_with("\n"));
        cles::protocol::request_line read;
        const auto text = line.substr(0, line.size() - 1);
        BOOST_REQUIRE(cles::protocol::parse_group_message(text, read));
        BOOST_TEST(*read.seq == seq);
        BOOST_TEST(read.noun.target == "car1");
        BOOST_REQUIRE(said.original);
        const bool is_signed = read.noun.path == "cles";
        BOOST_TEST(is_signed == !read.sig.empty());
        BOOST_TEST(security->is_signed("car1", "cles", seq, node.host->epoch, said.original->body, said.original->sig));
        return is_signed ? "signed " + std::to_string(seq)
                         : "load " + std::to_string(seq) + " " + std::string{read.body};
    }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::core::signed_announcer announcer{*node.host};
    std::uint64_t seq = 0;
};

} // namespace
} // namespace signed_announcer

BOOST_FIXTURE_TEST_SUITE(signed_announcer, fixture)

BOOST_AUTO_TEST_CASE(in_the_group_every_other_one_is_signed) {
    BOOST_TEST(announce() == "signed 1");
    auto busy = content();
    busy.load.queued = 3;
    BOOST_TEST(announce(busy) == "load 1 {\"queued\":3,\"running\":0,\"workers\":4}");
    BOOST_TEST(announce() == "signed 2");
    BOOST_TEST(announce().starts_with("load 2 "));
}

BOOST_AUTO_TEST_CASE(a_node_that_looks_for_this_one_gets_the_whole_one) {
    BOOST_TEST(announce() == "signed 1");
    announcer.sign_next();
    BOOST_TEST(announce() == "signed 2");
    BOOST_TEST(announce().starts_with("load 2 "));
}

BOOST_AUTO_TEST_CASE(what_has_changed_is_signed) {
    const std::vector<void (*)(announcement&)> changes{
        [](announcement& a) { a.endpoints.clear(); },
        [](announcement& a) { a.sources.resize(1); },
        [](announcement& a) { a.load.workers = 5; },
        [](announcement& a) { a.interval = 2s; },
        [](announcement& a) { a.tasks = "85944171f73967e8"; },
        [](announcement& a) { a.leaving = true; },
        [](announcement& a) { a.roster = 8; },
        [](announcement& a) { a.signed_tasks = {"control"}; },
    };
    BOOST_TEST(announce() == "signed 1");
    auto said = content();
    for (const auto change : changes) {
        change(said);
        BOOST_TEST(announce(said).starts_with("signed "));
    }
    BOOST_TEST(announce(said).starts_with("load "));
}

BOOST_AUTO_TEST_CASE(by_gossip_alone_only_news_are_signed) {
    BOOST_TEST(announce(content(), false, true) == "signed 1");
    auto busy = content();
    busy.load.queued = 3;
    for (int i = 0; i < 3; ++i) {
        BOOST_TEST(announce(busy, false, true).starts_with("load 1 "));
    }
    busy.load.workers = 5;
    BOOST_TEST(announce(busy, false, true) == "signed 2");
}

BOOST_AUTO_TEST_CASE(what_is_news_for_gossip_is_signed_in_the_group_too) {
    BOOST_TEST(announce(content(), true, true) == "signed 1");
    auto slow = content();
    slow.load.service_us = 1'000'000;
    BOOST_TEST(announce(slow, true, true) == "signed 2");
}

BOOST_AUTO_TEST_SUITE_END()
