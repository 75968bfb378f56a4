//! What the ADCs of Espressif's chips have in common.

use esp_hal::analog::adc::Attenuation;

/// Range of the inputs: up to about 3.1 V (ESP32) or 2.5 V (ESP32-C3), which holds the 2 V of the driving layer.
pub const ATTENUATION: Attenuation = Attenuation::_11dB;
