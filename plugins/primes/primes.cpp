// SPDX-License-Identifier: BSL-1.0
#include "primes.hpp"

#include <cles/setting_error.hpp>
#include <cles/types.hpp>

#include "prime_counter.hpp"

#include <boost/describe/class.hpp>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

namespace primes {

struct range {
    std::optional<std::uint64_t> from;
    std::uint64_t below = 0;
};
BOOST_DESCRIBE_STRUCT(range, (), (from, below))

struct division {
    std::uint64_t below = 0;
    std::optional<std::uint64_t> parts;
};
BOOST_DESCRIBE_STRUCT(division, (), (below, parts))

struct found {
    std::uint64_t count = 0;
    std::uint64_t largest = 0;
};
BOOST_DESCRIBE_STRUCT(found, (), (count, largest))

namespace {

using cles::errc;
using cles::error;

constexpr std::uint64_t default_limit = 1'000'000'000;
constexpr std::uint64_t most = 1'000'000'000'000; // the divisors of more take seconds to begin with
constexpr std::uint64_t default_parts = 4;
constexpr std::uint64_t most_parts = 64;

void check(std::uint64_t number, std::uint64_t limit) {
    if (number > limit) {
        throw error(errc::bad_request, std::to_string(number) + " exceeds the limit of " + std::to_string(limit));
    }
}

void count(const cles::request& asked, const cles::responder& answer, std::uint64_t limit) {
    const auto wanted = asked.as<range>();
    check(wanted.below, limit);
    prime_counter counter{wanted.from.value_or(0), wanted.below};
    int reported = 0;
    while (counter.step()) {
        if (answer.stopped()) {
            answer.fail(errc::cancelled, "stopped");
            return;
        }
        if (const auto percent = static_cast<int>(counter.part_done() * 100); percent > reported) {
            reported = percent;
            answer.progress(counter.part_done(), found{counter.count(), counter.largest()});
        }
    }
    answer.done(found{counter.count(), counter.largest()});
}

// The parts that others count, and what they come to.
class division_of_labour : public std::enable_shared_from_this<division_of_labour> {
  public:
    division_of_labour(cles::responder answer, std::size_t parts)
        : answer_(std::move(answer)), left_(parts), of_(parts) {}

    void ask(const std::string& node, const range& part) {
        const auto command = "DELEGATE " + node + ":primes " + cles::to_json(part);
        answer_.delegate(command,
                         [self = shared_from_this()](boost::system::error_code failed, std::string_view json,
                                                     std::string_view words) { self->take(failed, json, words); });
    }

  private:
    void take(boost::system::error_code failed, std::string_view json, std::string_view words) {
        found part;
        std::string why{words};
        if (!failed && !cles::from_json(json, part, &why)) {
            failed = errc::failed;
        }
        const std::scoped_lock lock{mutex_}; // answers may come at once on several threads
        if (over_) {
            return;
        }
        if (failed) {
            over_ = true;
            const bool known = failed.category() == cles::error_category();
            answer_.fail(known ? static_cast<errc>(failed.value()) : errc::unavailable, "a part failed: " + why);
            return;
        }
        total_.count += part.count;
        total_.largest = std::max(total_.largest, part.largest);
        if (--left_ == 0) {
            answer_.done(total_);
        } else {
            answer_.progress(1 - static_cast<double>(left_) / static_cast<double>(of_), total_);
        }
    }

    cles::responder answer_;
    std::mutex mutex_;
    std::size_t left_;
    std::size_t of_;
    bool over_ = false;
    found total_;
};

void divide(const cles::request& asked, const cles::responder& answer, std::uint64_t limit, const std::string& node) {
    const auto wanted = asked.as<division>();
    check(wanted.below, limit);
    const auto parts = std::clamp<std::uint64_t>(wanted.parts.value_or(default_parts), 1, most_parts);
    const auto work = std::make_shared<division_of_labour>(answer, static_cast<std::size_t>(parts));
    for (std::uint64_t i = 0; i < parts; ++i) {
        work->ask(node, {.from = wanted.below * i / parts, .below = wanted.below * (i + 1) / parts});
    }
    // Returns here, and so holds no worker while the others count.
}

} // namespace

void settings::check() const {
    if (limit.value_or(default_limit) > most) {
        throw cles::setting_error("limit", "the limit is at most " + std::to_string(most));
    }
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    const auto limit = wanted.limit.value_or(default_limit);
    cles::typed_registrar tasks{to};
    tasks.on_pull("prime",
                  [limit](const cles::request& asked) {
                      const auto number = asked.parameter<std::uint64_t>(0);
                      check(number, limit);
                      return is_prime(number);
                  },
                  {.description = "Whether a number is prime", .parameters = {"number"}, .idempotent = true});
    tasks.on_delegate(
        "primes", [limit](const cles::request& asked, const cles::responder& answer) { count(asked, answer, limit); },
        {.description = "Counts the primes from 'from' up to 'below'", .idempotent = true},
        {.body = cles::schema_of<range>(), .result = cles::schema_of<found>()});
    tasks.on_delegate(
        "primes_in_parts",
        [limit, node = wanted.parts_by.value_or("any")](const cles::request& asked, const cles::responder& answer) {
            divide(asked, answer, limit, node);
        },
        {.description = "Counts the primes below 'below', in 'parts' that others count", .idempotent = true},
        {.body = cles::schema_of<division>(), .result = cles::schema_of<found>()});
}

} // namespace primes
