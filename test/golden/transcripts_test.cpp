// SPDX-License-Identifier: BSL-1.0
// Every recorded conversation of version 1, held again with the node as it is now.
#include <cles/error.hpp>
#include <cles/verb.hpp>

#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "replay.hpp"
#include "transcript_files.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <string_view>

namespace transcripts {
namespace {

/// Whether a line that begins with `head` (a link's letter apart) holds `text`.
bool spoken(std::string_view head, const std::string& text) {
    for (const auto& t : cles::test::transcripts()) {
        std::string_view rest = t.text;
        while (!rest.empty()) {
            const auto end = std::min(rest.find('\n'), rest.size());
            const auto line = rest.substr(0, end);
            rest.remove_prefix(std::min(end + 1, rest.size()));
            if (line.substr(0, 3).find(head) != std::string_view::npos && line.find(text) != std::string_view::npos) {
                return true;
            }
        }
    }
    return false;
}

} // namespace
} // namespace transcripts

BOOST_AUTO_TEST_SUITE(transcripts)

BOOST_AUTO_TEST_CASE(a_node_talks_as_it_always_did) {
    const auto all = cles::test::transcripts();
    BOOST_TEST(all.size() >= 15U);
    for (const auto& t : all) {
        for (const auto& problem : cles::test::replay(t.text)) {
            BOOST_ERROR(t.name + ", " + problem);
        }
    }
}

BOOST_AUTO_TEST_CASE(they_speak_of_every_verb) {
    for (const auto verb : cles::verb_names) {
        BOOST_TEST(spoken("> ", std::string{verb} + " "), verb);
        BOOST_TEST(spoken("< ", std::string{verb} + " "), verb);
    }
}

BOOST_AUTO_TEST_CASE(they_speak_of_every_adverb) {
    for (const std::string_view key : {"id", "deadline", "reply", "hops", "progress", "lease", "every", "keep", "seq",
                                       "epoch", "via", "must_understand"}) {
        BOOST_TEST(spoken("> ", " " + std::string{key} + "="), key);
    }
}

BOOST_AUTO_TEST_CASE(they_speak_of_every_error) {
    for (int code = 1; code <= 10; ++code) {
        const std::string name{wire_name(static_cast<cles::errc>(code))};
        BOOST_TEST(spoken("< ", "{\"error\":\"" + name + "\""), name); // answered
        BOOST_TEST(spoken("= ", " failed " + name), name);             // and understood
    }
}

BOOST_AUTO_TEST_SUITE_END()
