// SPDX-License-Identifier: BSL-1.0
#include "node/session/handler_failure.hpp"

#include <cles/error.hpp>

#include <boost/system/system_error.hpp>

#include <string>
#include <string_view>
#include <system_error>

namespace cles::core {
namespace {

std::string without_paths(std::string_view text) {
    constexpr std::string_view before = " '\"(=:,[<\t\n";
    constexpr std::string_view after = " '\")],;>\t\n";
    std::string out;
    for (std::size_t i = 0; i < text.size();) {
        const bool starts_word = i == 0 || before.find(text[i - 1]) != std::string_view::npos;
        const bool names_root =
            text[i] == '/' && i + 1 < text.size() && after.find(text[i + 1]) == std::string_view::npos;
        if (starts_word && names_root) {
            out += "...";
            i = text.find_first_of(after, i);
            if (i == std::string_view::npos) {
                break;
            }
        } else {
            out.push_back(text[i++]);
        }
    }
    return out;
}

bool crosses_the_wire(errc code) { return static_cast<int>(code) < static_cast<int>(errc::would_deadlock); }

} // namespace

protocol::failure describe(const std::exception_ptr& thrown) {
    protocol::failure result;
    try {
        std::rethrow_exception(thrown);
    } catch (const error& e) {
        const bool ours = e.code().category() == error_category();
        const auto code = static_cast<errc>(e.code().value());
        result.code = ours && crosses_the_wire(code) ? code : errc::failed;
        result.message = without_paths(ours ? e.message() : e.code().message());
    } catch (const boost::system::system_error& e) {
        result.message = e.code().message(); // its what() may name source files
    } catch (const std::system_error& e) {
        result.message = e.code().message();
    } catch (const std::exception& e) {
        result.message = without_paths(e.what());
    } catch (...) {
        result.message = "the handler failed";
    }
    return result;
}

} // namespace cles::core
