import { Button, Group, Skeleton, Stack, Title } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { Fragment } from "react";
import { Link } from "wouter";
import { useCatalogue } from "../../api/queries";
import type { Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { ErrorNotice } from "../../ui/Notices";
import classes from "../../ui/Page.module.css";
import { useTitle } from "../../ui/useTitle";
import { VehicleCard } from "./VehicleCard";

/** All vehicles: registered ones first, then shared simulations. */
export function VehiclesPage() {
  useTitle("Vehicles");
  const vehicles = useVehicles();
  const ofKind = (registered: boolean) => vehicles.data?.filter((vehicle) => vehicle.registered === registered) ?? [];
  const registered = ofKind(true);
  return (
    <>
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Vehicles</Title>
        <Button component={Link} to="/vehicles/new" leftSection={<IconPlus size={20} aria-hidden />}>
          Register a vehicle
        </Button>
      </Group>
      <ErrorNotice error={vehicles.error} />
      {vehicles.isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {vehicles.data && registered.length === 0 && <NoVehicles />}
      <Stack gap={28}>
        <Vehicles title="Registered vehicles" vehicles={registered} />
        <Vehicles title="Shared simulations and vehicles flown elsewhere" vehicles={ofKind(false)} />
      </Stack>
    </>
  );
}

function Vehicles({ title, vehicles }: { title: string; vehicles: readonly Vehicle[] }) {
  if (vehicles.length === 0) return null;
  return (
    <section>
      <Title order={2} c="dimmed" fz="body" mb={10}>
        {title}
      </Title>
      <Stack component="ul" gap={10} aria-label={title}>
        {vehicles.map((vehicle) => (
          <VehicleCard key={vehicle.id} vehicle={vehicle} />
        ))}
      </Stack>
    </section>
  );
}

/** Empty state: explains registration, and how to try it without a drone. */
function NoVehicles() {
  const [usual, ...others] = useCatalogue().data?.autopilots ?? [];
  return (
    <div className={classes["teach"]}>
      <p>
        <strong>No vehicle is registered yet.</strong> A registered vehicle keeps its link open between flights. Every
        page shows its battery, gains and operator.
      </p>
      {usual && (
        <p>
          To try it without a drone, run <code>gainline sim-drone</code> in a terminal (from a checkout{" "}
          <code>./dev exec gainline sim-drone</code>) and register it as simulated, with the autopilot {usual.title} at{" "}
          <code>{usual.simulated_address}</code>. With{" "}
          {others.map(({ name }, place) => (
            <Fragment key={name}>
              {place > 0 && " or "}
              <code>--autopilot {name}</code>
            </Fragment>
          ))}
          , it is at <code>{others[0]?.simulated_address}</code>.
        </p>
      )}
    </div>
  );
}
