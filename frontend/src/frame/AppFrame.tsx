import { Box, Stack } from "@mantine/core";
import { useWindowEvent } from "@mantine/hooks";
import { useQueryClient } from "@tanstack/react-query";
import { type ReactNode, Suspense, useEffect, useEffectEvent, useLayoutEffect, useRef } from "react";
import { Link, useLocation, useRoute, useSearchParams } from "wouter";
import { useReadOnlyReason, useUnlocked } from "../api/access";
import { useRenewedControl } from "../api/control";
import { useCampaign } from "../api/queries";
import { useVehicle } from "../api/vehicles";
import { AbortContext, useAbort, useFlying } from "../live/flights";
import { followEvents, liveFlightsNow, useConnection } from "../live/store";
import { VehicleBadge } from "../ui/Badges";
import { ReadOnlyNotice, UnlockedNotice } from "../ui/Notices";
import classes from "./Frame.module.css";
import { ConnectionNotice, ConnectionState, FlyingBar, ThemeSwitch } from "./HeaderBar";
import { KeyboardHelp } from "./KeyboardHelp";
import { abortTargets, type Flying } from "./keys";
import { MainNav } from "./MainNav";
import { PageGuard } from "./PageGuard";
import { SpokenAnnouncements } from "./SpokenAnnouncements";
import { VehicleStrip } from "./VehicleStrip";

/**
 * Space aborts the flight whatever has the focus, including text fields.
 * The stream reports a flight before the list does, so both are used.
 */
function useSpaceAborts(
  listed: readonly Flying[],
  campaignId: number | null,
  press: (trialIds: readonly number[]) => void,
): void {
  function onKey(event: KeyboardEvent): void {
    const targets = abortTargets([...listed, ...liveFlightsNow()], campaignId);
    if (event.code !== "Space" || targets.length === 0) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat && event.type === "keydown") press([...new Set(targets.map(({ trialId }) => trialId))]);
  }
  useWindowEvent("keydown", onKey, { capture: true });
  // Buttons act on keyup, so it is suppressed too.
  useWindowEvent("keyup", onKey, { capture: true });
}

function useEventStream(flying: boolean): void {
  const queries = useQueryClient();
  const somethingFlies = useEffectEvent(() => flying);
  useEffect(() => followEvents(queries, () => somethingFlies()), [queries]);
}

/** Vehicle of the campaign that is open, while it does not fly: then its name is beside its readings. */
function CampaignVehicle({ campaignId }: { campaignId: number }) {
  const vehicle = useCampaign(campaignId).data?.vehicle;
  const state = useVehicle(vehicle?.id ?? null)?.state;
  // A connected vehicle has its own line below.
  if (vehicle === undefined || (vehicle.registered && state !== "disconnected")) return null;
  return <VehicleBadge isReal={vehicle.is_real} title={vehicle.registered ? vehicle.name : vehicle.title} />;
}

/** A page that a link opens begins at its top; going back leaves the place to the browser. */
function usePagesOpenAtTop(): void {
  const [pathname] = useLocation();
  const shown = useRef(pathname);
  const isByLink = useRef(false);
  // Sent by wouter; when `popstate` is sent, the page before may already be shown.
  useWindowEvent("pushState", () => {
    isByLink.current = window.location.pathname !== shown.current;
  });
  useLayoutEffect(() => {
    if (pathname === shown.current) return;
    shown.current = pathname;
    if (isByLink.current && window.location.hash === "") window.scrollTo(0, 0);
    isByLink.current = false;
  }, [pathname]);
}

export function AppFrame({ children }: { children: ReactNode }) {
  const [isOnPage, params] = useRoute("/campaigns/:campaignId/*?");
  const campaignId = isOnPage ? Number(params.campaignId) : null;
  const flying = useFlying();
  const abort = useAbort(flying);
  const [pathname] = useLocation();
  const onFlyScreen = useRoute("/fly/:trialId")[0];
  const isInFlight = flying.length > 0;
  useEventStream(isInFlight);
  useRenewedControl();
  usePagesOpenAtTop();
  const { state } = useConnection();
  const watching = useReadOnlyReason(null);
  const unlocked = useUnlocked();
  const [parameters] = useSearchParams();
  useSpaceAborts(flying, campaignId, abort.press);
  const isOwnInAir = flying.some((one) => one.campaignId === campaignId);
  return (
    <div className={onFlyScreen ? classes["whole"] : undefined}>
      <a href="#main" className={`${classes["skip"]} visually-hidden`}>
        Skip to content
      </a>
      <header className={classes["header"]}>
        <div className={classes["bar"]}>
          <Link to="/" className={classes["home"]} aria-label="Gainline, all campaigns">
            <img src="/icon.svg" alt="" width={32} height={32} />
            <Box component="span" visibleFrom="xs">
              Gainline
            </Box>
          </Link>
          <MainNav isInFlight={isInFlight} />
          <Box className={classes["vehicle"]} visibleFrom={isInFlight ? "xs" : undefined}>
            {campaignId !== null && Number.isInteger(campaignId) && !isOwnInAir && (
              <CampaignVehicle campaignId={campaignId} />
            )}
          </Box>
          <Stack gap={6} miw={0} ml="auto" py={8}>
            {flying.map((one) => (
              <FlyingBar key={one.trialId} flying={one} abort={abort} />
            ))}
          </Stack>
          <ConnectionState />
          <ThemeSwitch />
          <KeyboardHelp />
        </div>
        {abort.trouble !== null && (
          <p className={classes["notice"]} data-tone="bad" role="alert">
            <strong>The abort is not confirmed.</strong> {abort.trouble} It is sent again until the worker confirms it.
            If a vehicle is in the air, use its own remote control now.
          </p>
        )}
        <VehicleStrip />
        <ConnectionNotice flying={flying} />
      </header>
      <SpokenAnnouncements />
      <main id="main" className={classes["main"]} tabIndex={-1} data-stale={state === "away" || undefined}>
        <ReadOnlyNotice why={watching} />
        <UnlockedNotice what={parameters.has("unlocked") ? unlocked : null} />
        <PageGuard path={pathname}>
          <Suspense fallback={<div aria-busy="true" />}>
            <AbortContext value={abort}>{children}</AbortContext>
          </Suspense>
        </PageGuard>
      </main>
    </div>
  );
}
