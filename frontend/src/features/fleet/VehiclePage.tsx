import { Anchor, Button, Group, SimpleGrid, Skeleton, Stack, Title } from "@mantine/core";
import { IconChevronLeft, IconPlugConnected, IconPlugConnectedX, IconPlus } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { Link, useParams } from "wouter";
import { useReadOnlyReason } from "../../api/access";
import { useVehicleRequest, type VehicleRequest } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { useVehicleStatus } from "../../live/store";
import { isArmed } from "../../live/vehicleStatus";
import { VehicleBadge } from "../../ui/Badges";
import { NotFoundPage } from "../../ui/NotFound";
import { ErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { useTitle } from "../../ui/useTitle";
import classes from "./Fleet.module.css";
import { BatteryPanel, LinkPanel } from "./LinkPanel";
import { OperatorControl } from "./OperatorControl";
import { QuarantinePanel } from "./QuarantinePanel";
import { SafeGains } from "./SafeGains";
import { VehicleHistory } from "./VehicleHistory";
import { CheckList, ParameterPanel } from "./VehicleReadings";
import { VehicleStateBadge } from "./VehicleStateBadge";

export function VehiclePage() {
  const vehicleId = Number(useParams()["vehicleId"]);
  const vehicles = useVehicles();
  const vehicle = vehicles.data?.find(({ id }) => id === vehicleId);
  useTitle(vehicle?.name ?? "Vehicle");
  if (vehicle?.registered === false) return <SharedView key={vehicle.id} vehicle={vehicle} />;
  if (vehicle !== undefined) return <VehicleView key={vehicle.id} vehicle={vehicle} />;
  if (vehicles.error) return <ErrorNotice error={vehicles.error} />;
  return vehicles.isPending ? <Skeleton height={420} radius="md" /> : <NotFoundPage />;
}

/** Name and state of the vehicle above its panels, with its buttons on the right. */
function VehicleHead({ vehicle, children }: { vehicle: Vehicle; children?: ReactNode }) {
  return (
    <Group justify="space-between" gap="6px 14px">
      <Group gap="6px 14px">
        <Anchor component={Link} to="/vehicles" c="dimmed" display="inline-flex" lh="44px">
          <IconChevronLeft size={20} style={{ alignSelf: "center" }} aria-hidden />
          Vehicles
        </Anchor>
        <Title order={1} style={{ overflowWrap: "anywhere" }}>
          {vehicle.name}
        </Title>
        <VehicleBadge isReal={vehicle.is_real} />
        <VehicleStateBadge vehicle={vehicle} />
      </Group>
      {children && <Group gap={8}>{children}</Group>}
    </Group>
  );
}

/** A shared simulation: no link, but a calibration and gain history. */
function SharedView({ vehicle }: { vehicle: Vehicle }) {
  return (
    <Stack gap={14}>
      <VehicleHead vehicle={vehicle} />
      {vehicle.state === "quarantined" && <QuarantinePanel vehicle={vehicle} />}
      <SimpleGrid type="container" cols={{ base: 1, "780px": 2 }} spacing="var(--gap)">
        <VehicleHistory vehicle={vehicle} />
      </SimpleGrid>
    </Stack>
  );
}

/** A registered vehicle: link, gains, control, battery, history and requests. */
function VehicleView({ vehicle }: { vehicle: Vehicle }) {
  const ask = useVehicleRequest(vehicle.id);
  const watching = useReadOnlyReason(vehicle);
  const status = useVehicleStatus(vehicle.id);
  const may = (act: Vehicle["actions"][number]): boolean => watching === null && vehicle.actions.includes(act);
  /** Props of the button for this request. */
  const asks = (act: VehicleRequest) => ({
    loading: ask.isPending && ask.variables === act,
    onClick: () => ask.mutate(act),
  });
  return (
    <Stack gap={14}>
      <VehicleHead vehicle={vehicle}>
        <Button
          component={Link}
          to={`/new?vehicle=${vehicle.id}`}
          variant="default"
          leftSection={<IconPlus size={20} aria-hidden />}
        >
          New campaign
        </Button>
        {may("connect") && (
          <Button leftSection={<IconPlugConnected size={20} aria-hidden />} {...asks("connect")}>
            Connect
          </Button>
        )}
        {may("disconnect") && (
          <Button variant="default" leftSection={<IconPlugConnectedX size={20} aria-hidden />} {...asks("disconnect")}>
            {vehicle.state === "disconnected" ? "Stop connecting" : "Disconnect"}
          </Button>
        )}
      </VehicleHead>
      <ReadOnlyNotice why={watching} />
      <ErrorNotice error={ask.error} />
      {vehicle.state === "quarantined" && <QuarantinePanel vehicle={vehicle} />}
      <SimpleGrid type="container" cols={{ base: 1, "780px": 2 }} spacing="var(--gap)">
        <LinkPanel vehicle={vehicle} mayEdit={may("configure")} />
        <SafeGains vehicle={vehicle} restore={asks("restore")} />
        <Panel title="Operator">
          {watching === null ? (
            <OperatorControl vehicle={vehicle} />
          ) : (
            <p>{vehicle.control?.operator ?? "No operator"} is in control.</p>
          )}
        </Panel>
        <BatteryPanel vehicle={vehicle} />
        <Panel
          title="Preflight checks"
          className={classes["wide"]}
          tools={
            <Button variant="default" disabled={!may("check") || isArmed(status)} {...asks("check")}>
              Check now
            </Button>
          }
        >
          <CheckList vehicle={vehicle} />
        </Panel>
        <VehicleHistory vehicle={vehicle} />
        <ParameterPanel vehicleId={vehicle.id} mayRead={may("parameters")} read={asks("parameters")} />
      </SimpleGrid>
    </Stack>
  );
}
