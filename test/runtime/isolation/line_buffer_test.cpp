// SPDX-License-Identifier: BSL-1.0
#include "isolation/line_buffer.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(line_buffer)

using buffer = cles::runtime::line_buffer;

namespace {

std::vector<std::string> taken(buffer& from) {
    std::vector<std::string> lines;
    while (const auto line = from.next()) {
        lines.emplace_back(*line);
    }
    return lines;
}

} // namespace

BOOST_AUTO_TEST_CASE(lines_are_the_same_however_the_text_arrives) {
    const std::string text = "one\n\nthree 3\nfour\nrest";
    const std::vector<std::string> lines{"one", "", "three 3", "four"};
    for (std::size_t size = 1; size <= text.size(); ++size) {
        buffer b;
        std::vector<std::string> all;
        for (std::size_t at = 0; at < text.size(); at += size) {
            b.append(text.substr(at, size));
            const auto some = taken(b);
            all.insert(all.end(), some.begin(), some.end());
        }
        BOOST_TEST(all == lines, boost::test_tools::per_element());
        BOOST_TEST(b.rest() == "rest");
    }
}

BOOST_AUTO_TEST_CASE(lines_may_be_taken_later) {
    buffer b;
    b.append("a\nb\nc");
    BOOST_TEST(*b.next() == "a");
    b.append("c\nd\n");
    BOOST_TEST(*b.next() == "b");
    BOOST_TEST(b.rest() == "cc\nd\n");
    BOOST_TEST(*b.next() == "cc");
    BOOST_TEST(*b.next() == "d");
    BOOST_TEST(!b.next());
    BOOST_TEST(b.rest().empty());
}

BOOST_AUTO_TEST_CASE(it_can_be_cleared) {
    buffer b;
    b.append("a\nrest");
    BOOST_TEST(*b.next() == "a");
    b.clear();
    b.append("b\n");
    BOOST_TEST(*b.next() == "b");
    BOOST_TEST(!b.next());
}

BOOST_AUTO_TEST_SUITE_END()
