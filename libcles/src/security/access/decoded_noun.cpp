// SPDX-License-Identifier: BSL-1.0
#include "security/access/decoded_noun.hpp"

namespace cles::security {

void decoded_noun::assign(std::string_view target, const protocol::noun_view& noun) {
    target_ = target;
    task_ = noun.task;
    parameters_ = noun.parameters;
    if (noun.path.find('%') == std::string_view::npos) {
        return;
    }
    decoded_.clear();
    decoded_.reserve(noun.path.size()); // never exceeded, so the views stay valid
    for (auto& parameter : parameters_) {
        const auto from = decoded_.size();
        protocol::decode_parameter(parameter, decoded_);
        parameter = std::string_view{decoded_}.substr(from);
    }
}

} // namespace cles::security
