// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_error.hpp"

#include <openssl/err.h>

#include <string>

namespace cles::tls {
namespace {

// OpenSSL's codes contain the number of a library in the bits from 23 on, and so exceed those of `tls_errc`.
constexpr int first_of_openssl = 1 << 23;

std::string message_of(tls_errc code) {
    switch (code) {
    case tls_errc::failed: break;
    case tls_errc::other_protocol: return "the other end does not speak cles/1 over TLS";
    case tls_errc::too_many_keys: return "the other end changes its TLS keys too often";
    case tls_errc::not_member: return "the other end's key is not in the roster";
    case tls_errc::other_name: return "another member answers there";
    case tls_errc::refused_by_peer: return "the other end refuses this node";
    case tls_errc::bad_admission: return "the other end sent another line before its welcome";
    case tls_errc::busy: return "too many links are being admitted";
    case tls_errc::removed: return "a member was removed from the roster";
    case tls_errc::needs_name: return "datagrams are sealed for a node whose name is known: give the name, or use tls";
    case tls_errc::unknown_name: return "no member of the fleet has the name of that node";
    }
    return "TLS failed";
}

class category final : public boost::system::error_category {
  public:
    constexpr category() noexcept : error_category(0x91F4'2D7C'0BE6'A853U) {} // see protocol/error.cpp

    [[nodiscard]] const char* name() const noexcept override { return "cles.tls"; }

    [[nodiscard]] std::string message(int value) const override {
        if (value < first_of_openssl) {
            return message_of(static_cast<tls_errc>(value));
        }
        const auto* reason = ::ERR_reason_error_string(static_cast<unsigned long>(value));
        return reason == nullptr ? "TLS failed" : std::string{"TLS: "} + reason;
    }

    [[nodiscard]] boost::system::error_condition default_error_condition(int value) const noexcept override {
        switch (static_cast<tls_errc>(value)) {
        case tls_errc::not_member:
        case tls_errc::other_name:
        case tls_errc::refused_by_peer:
        case tls_errc::removed:
        case tls_errc::needs_name:
        case tls_errc::unknown_name:
            return boost::system::errc::make_error_condition(boost::system::errc::permission_denied);
        case tls_errc::busy:
            return boost::system::errc::make_error_condition(boost::system::errc::device_or_resource_busy);
        default: return {value, *this};
        }
    }
};

} // namespace

const boost::system::error_category& tls_category() noexcept {
    static const category instance;
    return instance;
}

boost::system::error_code take_openssl_error() noexcept {
    const auto code = ::ERR_get_error();
    ::ERR_clear_error();
    const auto value = static_cast<int>(code & 0x7FFFFFFFU);
    return value < first_of_openssl ? make_error_code(tls_errc::failed)
                                    : boost::system::error_code{value, tls_category()};
}

} // namespace cles::tls
