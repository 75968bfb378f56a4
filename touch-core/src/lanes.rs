//! More numbers at once, where a processor can.

/// Calls a function that is inlined with all that it calls, as the processor at hand can do it best.
#[inline(always)]
pub(crate) fn at_once<R>(function: impl FnOnce() -> R) -> R {
    #[cfg(feature = "wide")]
    return pulp::Arch::new().dispatch(function);
    #[cfg(not(feature = "wide"))]
    function()
}
