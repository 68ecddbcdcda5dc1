// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "sgd/order.hpp"

#include <vector>

namespace dsgd {

/// Trains each shard in a thread of this process: what delegating is to be measured by.
/// \param orders with `epochs`, `rate` and `seed`, and with shards of this data
std::vector<sgd::trained> train_here(const sgd::data_set& data, const std::vector<sgd::order>& orders);

} // namespace dsgd
