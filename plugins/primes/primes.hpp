// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace primes {

struct settings {
    std::optional<std::uint64_t> limit;    ///< up to where primes are looked for; 10^9 unless set, at most 10^12
    std::optional<std::string> parts_by{}; ///< the node for the parts of `primes_in_parts`: a name, or `any` (default)

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (limit, parts_by))

/// A plugin that computes: stoppably, telling how far it is, and by asking others.
///
/// - PULL prime/<n>: whether n is one
/// - DELEGATE primes {"from","below"}: how many there are, and the largest
/// - DELEGATE primes_in_parts {"below","parts"}: the same, each part being delegated to a node that offers `primes`
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace primes
