// SPDX-License-Identifier: BSL-1.0
#include "transport/transports.hpp"

#include <cles/link.hpp>

#include <functional>
#include <map>
#include <string>
#include <utility>

namespace cles {
namespace {

using table = std::map<std::string, std::unique_ptr<link_transport>, std::less<>>;

table& transports() {
    static table instance = [] {
        table t;
        t.emplace("tcp", transport::make_tcp());
        t.emplace("udp", transport::make_udp());
        t.emplace("unix", transport::make_unix());
        t.emplace("inproc", transport::make_inproc());
        return t;
    }();
    return instance;
}

} // namespace

link_transport* find_transport(std::string_view scheme) {
    const auto found = transports().find(scheme);
    return found == transports().end() ? nullptr : found->second.get();
}

std::unique_ptr<link_transport> register_transport(std::string_view scheme, std::unique_ptr<link_transport> carrier) {
    return std::exchange(transports()[std::string{scheme}], std::move(carrier));
}

} // namespace cles
