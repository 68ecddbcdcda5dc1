// SPDX-License-Identifier: BSL-1.0
#include "node/routing/next_hop.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(next_hop)

namespace {

constexpr auto trace_value = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

cles::protocol::request_line parsed(std::string_view line) {
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why << " in " << line);
    return r;
}

std::string adverbs(const std::string& line, std::string_view requester = {}) {
    const auto r = parsed(line);
    const auto all = cles::core::forwarded_adverbs(r, cles::core::hops_after(r), "car1", {.requester = requester});
    BOOST_TEST(static_cast<std::ptrdiff_t>(all.count) == 1 + std::count(all.text.begin(), all.text.end(), ' '));
    if (!cles::core::has_adverbs_to_forward(r)) {
        BOOST_TEST(all.text ==
                   cles::core::forwarded_adverbs({}, cles::core::hops_after(r), "car1", {.requester = requester}).text);
    }
    return all.text;
}

std::string unknown(int count) {
    std::string all;
    for (int i = 0; i < count; ++i) {
        all += std::string{" x"} + static_cast<char>('a' + i) + "=1";
    }
    return all;
}

std::ptrdiff_t count_unknown(std::string_view adverbs) { return std::count(adverbs.begin(), adverbs.end(), 'x'); }

} // namespace

BOOST_AUTO_TEST_CASE(hops_are_one_less_and_this_node_is_the_last_in_via) {
    BOOST_TEST(adverbs("PULL car2:speed") == "hops=7 via=car1");
    BOOST_TEST(adverbs("PULL car2:speed via=car8,car9 hops=16") == "hops=15 via=car8,car9,car1");
    BOOST_TEST(adverbs("PULL car2:speed hops=0") == "hops=0 via=car1");
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_forwarded_and_known_ones_are_not) {
    BOOST_TEST(adverbs("PUSH car2:log id=7 a=1 deadline=9 reply=no b=x=y {\"c\":2}") == "hops=7 via=car1 a=1 b=x=y");
}

BOOST_AUTO_TEST_CASE(adverb_of_another_verb_is_unknown) {
    BOOST_TEST(adverbs("PULL car2:speed keep=7 progress=yes seq=0") == "hops=7 via=car1 keep=7 progress=yes seq=0");
}

// As docs/protocol.md states.
BOOST_AUTO_TEST_CASE(number_of_adverbs_is_bounded) {
    const auto trace = std::string{" trace="} + trace_value;
    BOOST_TEST(count_unknown(adverbs("PULL car2:speed" + unknown(16))) == 10);
    BOOST_TEST(count_unknown(adverbs("DELEGATE car2:work" + unknown(16))) == 10);
    BOOST_TEST(count_unknown(adverbs("BIND car2:speed" + unknown(16))) == 8);
    BOOST_TEST(count_unknown(adverbs("PULL car2:speed" + trace + unknown(15))) == 9);
    BOOST_TEST(count_unknown(adverbs("PULL car2:speed sig=s" + unknown(15))) == 9);
    BOOST_TEST(count_unknown(adverbs("PULL car2:speed sig=s from=car8" + trace + unknown(13), "car8")) == 7);
}

BOOST_AUTO_TEST_CASE(what_is_forwarded_never_has_too_many_adverbs) {
    for (const std::string how : {"PULL", "PUSH", "DELEGATE", "BIND", "UPDATE"}) {
        const auto line = how + " car2:speed sig=s from=car8 trace=" + trace_value + unknown(13);
        const auto r = parsed(line);
        const auto further = cles::core::forwarded_adverbs(r, cles::core::hops_after(r), "car1", {.requester = "car8"});
        std::string text;
        cles::protocol::append_request(text, {.verb = r.verb,
                                              .noun = "car2:speed",
                                              .id = 1,
                                              .deadline_ms = 1,
                                              .wants_reply = how != "PUSH" && how != "UPDATE",
                                              .wants_progress = how == "DELEGATE",
                                              .carried = {.urgent = how != "BIND" && how != "UPDATE", .trace = r.trace},
                                              .lease_ms = how == "BIND" ? std::optional{1U} : std::nullopt,
                                              .every_ms = how == "BIND" ? 1U : 0U,
                                              .keep = how == "BIND" ? 1U : 0U,
                                              .wants_mark = how == "BIND",
                                              .adverbs = further.text});
        parsed(std::string_view{text}.substr(0, text.size() - 1));
    }
}

BOOST_AUTO_TEST_SUITE_END()
