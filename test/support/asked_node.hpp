// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <string>

namespace cles::test {

/// A node to whose own tasks a test sends requests as text.
struct asked_node {
    /// The reply, or the message of the failure.
    std::string ask(const std::string& command) {
        try {
            return node.request(command);
        } catch (const error& e) {
            return e.what();
        }
    }

    boost::asio::io_context io;
    service node{io, {.name = "node"}};
};

} // namespace cles::test
