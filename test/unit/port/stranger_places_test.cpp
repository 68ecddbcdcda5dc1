// SPDX-License-Identifier: BSL-1.0
#include "port/stranger_places.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stranger_places {
namespace {

struct holder;
using places = cles::core::stranger_places<holder>;

struct holder {
    holder(places& in, std::string called, std::string_view source)
        : name(std::move(called)), held(in.take(source, *this)) {}

    std::string name;
    places::place held;
};

std::string first(const places& in) {
    const auto* const found = in.first_to_yield();
    return found == nullptr ? "nobody" : found->name;
}

} // namespace
} // namespace stranger_places

BOOST_AUTO_TEST_SUITE(stranger_places)

BOOST_AUTO_TEST_CASE(the_oldest_of_the_source_with_most_yields_first) {
    places all;
    BOOST_TEST(first(all) == "nobody");
    BOOST_TEST((all.oldest() == nullptr));
    holder a{all, "a", "10.0.0.1"};
    holder b{all, "b", "10.0.0.2"};
    BOOST_TEST(first(all) == "a"); // both have one
    holder c{all, "c", "10.0.0.2"};
    BOOST_TEST(first(all) == "b");
    BOOST_TEST(all.oldest()->name == "a"); // whatever its source
    BOOST_TEST(all.size() == 3U);
    BOOST_TEST(all.held_by("10.0.0.2") == 2U);
    BOOST_TEST(all.held_by("10.0.0.3") == 0U);
    b.held.release();
    BOOST_TEST(first(all) == "a");
    a.held.release();
    BOOST_TEST(first(all) == "c");
    BOOST_TEST(all.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_place_ends_once_and_can_be_moved) {
    places all;
    {
        const holder a{all, "a", "x"};
        BOOST_TEST(all.held_by("x") == 1U);
    }
    BOOST_TEST(all.size() == 0U);
    holder b{all, "b", "x"};
    auto moved = std::move(b.held);
    BOOST_TEST(!b.held.is_held()); // NOLINT(bugprone-use-after-move): it is empty
    BOOST_TEST(moved.is_held());
    b.held.release();
    BOOST_TEST(all.size() == 1U);
    moved = all.take("y", b);
    BOOST_TEST(all.held_by("x") == 0U);
    BOOST_TEST(all.held_by("y") == 1U);
    moved.release();
    moved.release();
    BOOST_TEST(all.size() == 0U);
}

BOOST_AUTO_TEST_CASE(what_is_held_in_places_is_added_up) {
    places all;
    holder a{all, "a", "x"};
    BOOST_TEST(all.amount() == 0U);
    a.held.set_amount(5);
    {
        holder b{all, "b", "y"};
        b.held.set_amount(7);
        BOOST_TEST(all.amount() == 12U);
    }
    a.held.set_amount(3);
    BOOST_TEST(a.held.amount() == 3U);
    BOOST_TEST(all.amount() == 3U);
    auto moved = std::move(a.held);
    BOOST_TEST(moved.amount() == 3U);
    BOOST_TEST(all.amount() == 3U);
    moved.release();
    BOOST_TEST(moved.amount() == 0U);
    BOOST_TEST(all.amount() == 0U);
}

BOOST_AUTO_TEST_CASE(a_place_may_outlive_them) {
    places::place kept;
    {
        places all;
        holder a{all, "a", "x"};
        kept = std::move(a.held);
    }
    BOOST_TEST(kept.is_held());
    kept.release();
}

BOOST_AUTO_TEST_SUITE_END()
