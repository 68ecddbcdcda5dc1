// SPDX-License-Identifier: BSL-1.0
#include "strike/ledger.hpp"
#include "support/temporary_folder.hpp"

#include <boost/test/unit_test.hpp>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace ledger {
namespace {

struct fixture {
    cles::test::temporary_folder folder{"cles-ledger"};
    std::string path = (folder / "orders").string();

    static strike::ledger_entry entry(const std::string& id) {
        return {.utc = 7,
                .event = "released",
                .requester = "mission",
                .what = {.id = id,
                         .lat = 33,
                         .lon = -106,
                         .sigma = 3,
                         .sigma_v = 1,
                         .utc = 6.5,
                         .until = 9,
                         .picture = "sat1 40"}};
    }
    void append(const std::string& text) const { std::ofstream{path, std::ios::app} << text; }
    [[nodiscard]] std::string why() const {
        try {
            const strike::ledger book{path};
            return {};
        } catch (const std::runtime_error& e) {
            return e.what();
        }
    }
};

} // namespace
} // namespace ledger

BOOST_FIXTURE_TEST_SUITE(ledger, fixture)

BOOST_AUTO_TEST_CASE(what_was_added_is_there_when_it_is_opened_again) {
    {
        strike::ledger book{path};
        BOOST_TEST(book.before().empty());
        book.add(entry("o1"));
        book.add(entry("o2"));
    }
    const strike::ledger book{path};
    BOOST_TEST_REQUIRE(book.before().size() == 2U);
    BOOST_TEST(book.before()[0].what.id == "o1");
    BOOST_TEST(book.before()[1].what.id == "o2");
    BOOST_TEST(book.before()[1].requester == "mission");
    BOOST_TEST(book.before()[1].what.picture.value() == "sat1 40");
    BOOST_TEST(!book.before()[1].what.again.has_value());
}

BOOST_AUTO_TEST_CASE(a_line_that_was_cut_off_is_removed) {
    strike::ledger{path}.add(entry("o1"));
    append("{\"utc\":8,\"eve");
    strike::ledger{path}.add(entry("o2"));
    const strike::ledger book{path};
    BOOST_TEST_REQUIRE(book.before().size() == 2U);
    BOOST_TEST(book.before()[1].what.id == "o2");
}

BOOST_AUTO_TEST_CASE(one_that_is_damaged_is_not_used) {
    strike::ledger{path}.add(entry("o1"));
    append("nonsense\n");
    BOOST_TEST(why().starts_with("line 2 of the ledger: "), why());
}

BOOST_AUTO_TEST_CASE(one_aircraft_at_a_time_uses_it) {
    const strike::ledger book{path};
    BOOST_TEST(why().starts_with("the ledger is in use: "), why());
}

BOOST_AUTO_TEST_CASE(one_that_cannot_be_opened_is_told_without_its_path) {
    path = (folder / "missing/orders").string();
    BOOST_TEST(why().starts_with("cannot open the ledger: "), why());
    BOOST_TEST(why().find("orders") == std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()
