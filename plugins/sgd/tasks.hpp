// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>

namespace sgd {

/// What the data is made from; see `recipe` for what is not set.
struct settings {
    std::optional<std::uint64_t> seed{};
    std::optional<std::uint64_t> per_class{}; ///< 1 to 10^7
    std::optional<double> separation{};

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (seed, per_class, separation))

/// Stochastic gradient descent on a shard of data that is made here, when this is called (paper, section 4.2).
///
/// - PULL sgd: what the data is made from
/// - DELEGATE sgd/train {"first","count","epochs","rate","seed"}: a linear classifier, trained on those points; see
///   `order` and `trained`. In one thread, stoppably, telling how far it is.
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace sgd
