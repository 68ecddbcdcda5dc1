// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <string>
#include <vector>

namespace digits {

struct settings {
    std::vector<std::string> files{}; ///< with this node's images; at least one

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (files))

/// Trains networks on the images in files of this node, which it reads when this is called. No image leaves it.
///
/// - PULL digits: how many images there are, and of which kind; see `offer`
/// - DELEGATE digits/train {"start","passes","rate","seed"}: the network, trained further; see `order` and `trained`.
///   In one thread, stoppably, telling how far it is.
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace digits
