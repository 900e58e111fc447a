import { Button, Skeleton } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { Link } from "react-router";
import { useVehicles } from "../../api/vehicles";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "../../ui/Page.module.css";
import { useTitle } from "../../ui/useTitle";
import { VehicleCard } from "./VehicleCard";

/** All vehicles: registered ones first, then shared simulations. */
export function VehiclesPage() {
  useTitle("Vehicles");
  const vehicles = useVehicles();
  const registered = vehicles.data?.filter((vehicle) => vehicle.registered) ?? [];
  const shared = vehicles.data?.filter((vehicle) => !vehicle.registered) ?? [];
  return (
    <>
      <div className={classes["head"]}>
        <h1 className={classes["title"]}>Vehicles</h1>
        <Button component={Link} to="/vehicles/new" leftSection={<IconPlus size={20} aria-hidden />}>
          Register a vehicle
        </Button>
      </div>
      <ErrorNotice error={vehicles.error} />
      {vehicles.isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {vehicles.data && registered.length === 0 && <NoVehicles />}
      <div className={classes["stack"]}>
        {registered.length > 0 && (
          <section>
            <h2 className={classes["section"]}>Registered vehicles</h2>
            <ul className={classes["list"]} aria-label="Registered vehicles">
              {registered.map((vehicle) => (
                <VehicleCard key={vehicle.id} vehicle={vehicle} />
              ))}
            </ul>
          </section>
        )}
        {shared.length > 0 && (
          <section>
            <h2 className={classes["section"]}>Shared simulations and flight records</h2>
            <ul className={classes["list"]} aria-label="Shared simulations">
              {shared.map((vehicle) => (
                <VehicleCard key={vehicle.id} vehicle={vehicle} />
              ))}
            </ul>
          </section>
        )}
      </div>
    </>
  );
}

/** Empty state: explains registration, and how to try it without a drone. */
function NoVehicles() {
  return (
    <div className={classes["teach"]}>
      <p>
        <strong>No vehicle is registered yet.</strong> A registered vehicle keeps its link open between flights. Every
        page shows its battery, gains and operator.
      </p>
      <p>
        To try it without a drone, run <code>gainline sim-drone</code> in a terminal and register it at{" "}
        <code>udp:127.0.0.1:4245@4244</code> as simulated.
      </p>
    </div>
  );
}
